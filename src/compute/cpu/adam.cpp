#include "compute/adam.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "compute/cpu/kernels.h"
#include "compute/host_memory.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "compute/cpu/adam.cpp"
#include <hwy/foreach_target.h>
// after foreach_target
#include <hwy/highway.h>

#ifndef TESSERA_CPU_ADAM_ONCE
#define TESSERA_CPU_ADAM_ONCE
namespace tessera::cpu {

// rate · sqrt(1 - β2^k) / (1 - β1^k) for k = 0 .. size - 1; the last value applies to all later counts.
using StepSizes = std::vector<float>;

}  // namespace tessera::cpu
#endif

HWY_BEFORE_NAMESPACE();
namespace tessera::cpu::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using Float = hn::CappedTag<float, 16>;
using Word = hn::RebindToUnsigned<Float>;

void adamRange(const Adam& a, const StepSizes& stepSizes, size_t begin, size_t end) {
  const Float d;
  const Word du;
  const hn::RebindToSigned<Float> di;
  const size_t lanes = hn::Lanes(d);
  float* parameters = hostPointer(a.parameters);
  float* gradients = hostPointer(a.gradients);
  float* firstMoments = hostPointer(a.firstMoments);
  float* secondMoments = hostPointer(a.secondMoments);
  uint32_t* counts = hostPointer(a.counts);
  const auto zero = hn::Zero(d), l2 = hn::Set(d, a.l2), epsilon = hn::Set(d, a.epsilon);
  const auto beta1 = hn::Set(d, a.beta1), beta2 = hn::Set(d, a.beta2);
  const auto rest1 = hn::Set(d, 1 - a.beta1), rest2 = hn::Set(d, 1 - a.beta2);
  const auto bound = hn::Set(d, a.bound);
  const auto lastStep = hn::Set(du, static_cast<uint32_t>(stepSizes.size() - 1));
  for (size_t i = begin; i < end; i += lanes) {
    const size_t count = std::min(lanes, end - i);
    const auto inside = hn::FirstN(d, count);
    auto g = hn::MaskedLoad(inside, d, gradients + i);
    auto active = inside;
    if (a.skipZeroGradients) {
      active = hn::Ne(g, zero);
      if (hn::AllFalse(d, active)) continue;
    }
    const auto theta = hn::MaskedLoad(inside, d, parameters + i);
    g = hn::MulAdd(l2, theta, g);
    const auto m0 = hn::MaskedLoad(inside, d, firstMoments + i), v0 = hn::MaskedLoad(inside, d, secondMoments + i);
    const auto m = hn::MulAdd(beta1, m0, hn::Mul(rest1, g));
    const auto v = hn::MulAdd(beta2, v0, hn::Mul(rest2, hn::Mul(g, g)));
    const auto k0 = hn::MaskedLoad(hn::RebindMask(du, inside), du, counts + i);
    const auto k = hn::IfThenElse(hn::RebindMask(du, active), hn::Add(k0, hn::Set(du, 1u)), k0);
    const auto size = hn::GatherIndex(d, stepSizes.data(), hn::BitCast(di, hn::Min(k, lastStep)));
    const auto moved = hn::NegMulAdd(size, hn::Div(m, hn::Add(hn::Sqrt(v), epsilon)), theta);
    const auto bounded = hn::IfThenElse(hn::Gt(hn::Abs(moved), bound), hn::CopySign(bound, moved), moved);
    hn::BlendedStore(bounded, active, d, parameters + i);
    hn::BlendedStore(m, active, d, firstMoments + i);
    hn::BlendedStore(v, active, d, secondMoments + i);
    hn::BlendedStore(k, hn::RebindMask(du, active), du, counts + i);
    hn::BlendedStore(zero, inside, d, gradients + i);
  }
}

}  // namespace tessera::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace tessera::cpu {

HWY_EXPORT(adamRange);

namespace {

StepSizes makeStepSizes(const Adam& a) {
  StepSizes sizes{0.0f};
  double power1 = 1, power2 = 1;
  // Continues until both bias corrections are 1 in float.
  for (int k = 1; k < (1 << 20); ++k) {
    power1 *= a.beta1;
    power2 *= a.beta2;
    sizes.push_back(static_cast<float>(a.rate * std::sqrt(1 - power2) / (1 - power1)));
    if (power1 < 1e-9 && power2 < 1e-9) break;
  }
  return sizes;
}

}  // namespace

void run(Context& context, const Adam& a) {
  if (isAnyAbove(a.overflowCounters, a.capacity)) {
    context.pool.forRanges(a.gradients.count, size_t{1} << 18, [&](size_t begin, size_t end) {
      std::fill(hostPointer(a.gradients) + begin, hostPointer(a.gradients) + end, 0.0f);
    });
    return;
  }
  if (a.rows && hostPointer(a.rows)[0] == hostPointer(a.rows)[1]) return;
  const StepSizes stepSizes = makeStepSizes(a);
  const auto range = HWY_DYNAMIC_DISPATCH(adamRange);
  context.pool.forRanges(a.parameters.count, size_t{1} << 16,
                         [&](size_t begin, size_t end) { range(a, stepSizes, begin, end); });
}

}  // namespace tessera::cpu
#endif

// Deferred networks, evaluated one segment at a time: the 16 hidden units lie side by side in vectors, and the values
// of the layer below are broadcast. The backward pass repeats the forward pass instead of storing its activations.

#include "compute/deferred.h"

#include <algorithm>
#include <cstring>
#include <vector>

#include "compute/cpu/kernels.h"
#include "compute/host_memory.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "compute/cpu/deferred.cpp"
#include <hwy/foreach_target.h>
// after foreach_target
#include <hwy/contrib/math/math-inl.h>
#include <hwy/highway.h>

#ifndef TESSERA_CPU_DEFERRED_ONCE
#define TESSERA_CPU_DEFERRED_ONCE
namespace tessera::cpu {

inline constexpr int kComposited = DeferredNetwork::kComposited, kInputs = DeferredNetwork::kInputs;
inline constexpr int kUnits = DeferredNetwork::kHidden;
inline constexpr int kParts = 16;  // partial network gradients; fixed, for the same bits with any number of threads

// Weights as vectors of units, or their gradients.
struct alignas(128) UnitRows {
  float first[kInputs + 1][kUnits];  // [input][unit], then the biases
  float second[kUnits + 1][kUnits];
  float third[3 + 1][kUnits];  // [channel][unit], then the biases of the channels
};

struct alignas(128) PackedNetwork {
  UnitRows forward;
  float toComposited[kUnits][kUnits];  // first layer, [unit][input], only the composited inputs, padded with zeros
  float toUnits[kUnits][kUnits];       // second layer, [unit][unit of the first layer]
};

}  // namespace tessera::cpu
#endif

HWY_BEFORE_NAMESPACE();
namespace tessera::cpu::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using Float = hn::CappedTag<float, kUnits>;
using Vector = hn::Vec<Float>;
constexpr int kLanes = static_cast<int>(hn::MaxLanes(Float()));
constexpr int kVectors = kUnits / kLanes;

struct Units {
  Vector v[kVectors];
};

HWY_INLINE Units load(const float* from) {
  Units units;
  for (int i = 0; i < kVectors; ++i) units.v[i] = hn::Load(Float(), from + i * kLanes);
  return units;
}

HWY_INLINE void store(const Units& units, float* to) {
  for (int i = 0; i < kVectors; ++i) hn::Store(units.v[i], Float(), to + i * kLanes);
}

// sum + factor · row
HWY_INLINE Units multiplyAdd(float factor, const Units& row, Units sum) {
  const Vector broadcast = hn::Set(Float(), factor);
  for (int i = 0; i < kVectors; ++i) sum.v[i] = hn::MulAdd(broadcast, row.v[i], sum.v[i]);
  return sum;
}

// start + Σ_i factors[i] · rows[i], with two independent sums to hide the latency.
template <int kCount>
HWY_INLINE Units combination(const float* factors, const float (*rows)[kUnits], Units start) {
  static_assert(kCount % 2 == 0);
  Units other;
  for (int i = 0; i < kVectors; ++i) other.v[i] = hn::Zero(Float());
  for (int k = 0; k < kCount; k += 2) {
    start = multiplyAdd(factors[k], load(rows[k]), start);
    other = multiplyAdd(factors[k + 1], load(rows[k + 1]), other);
  }
  for (int i = 0; i < kVectors; ++i) start.v[i] = hn::Add(start.v[i], other.v[i]);
  return start;
}

HWY_INLINE Units zeroUnits() {
  Units units;
  for (int i = 0; i < kVectors; ++i) units.v[i] = hn::Zero(Float());
  return units;
}

HWY_INLINE Units relu(Units units) {
  for (int i = 0; i < kVectors; ++i) units.v[i] = hn::Max(units.v[i], hn::Zero(Float()));
  return units;
}

// The gradients of active units (above zero); zero for all others.
HWY_INLINE Units whereActive(const float* activations, Units gradients) {
  for (int i = 0; i < kVectors; ++i) {
    const auto active = hn::Gt(hn::Load(Float(), activations + i * kLanes), hn::Zero(Float()));
    gradients.v[i] = hn::IfThenElseZero(active, gradients.v[i]);
  }
  return gradients;
}

// The values of all layers of the network for one segment.
struct alignas(128) Activations {
  float first[kUnits], second[kUnits];
  float output[kUnits];      // only 3 are used
  float input[kInputs + 4];  // with padding for the last vector of cosines
};

// FrequencyForward's order: the direction, then 12 sines, then 12 cosines.
HWY_INLINE void encodeDirection(const float* direction, float* encoded) {
  const Float d;
  alignas(128) float angles[kUnits] = {};
  for (int i = 0; i < 12; ++i) angles[i] = direction[i % 3] * static_cast<float>(1 << i / 3);
  for (int i = 0; i < 3; ++i) encoded[i] = direction[i];
  for (int i = 0; i < kUnits; i += kLanes) hn::StoreU(hn::Sin(d, hn::Load(d, angles + i)), d, encoded + 3 + i);
  for (int i = 0; i < kUnits; i += kLanes) hn::StoreU(hn::Cos(d, hn::Load(d, angles + i)), d, encoded + 15 + i);
}

HWY_INLINE void throughNetwork(const UnitRows& network, Activations& a) {
  const Float d;
  store(relu(combination<kInputs>(a.input, network.first, load(network.first[kInputs]))), a.first);
  const Units second = relu(combination<kUnits>(a.first, network.second, load(network.second[kUnits])));
  store(second, a.second);
  for (int c = 0; c < 3; ++c) {
    const Units row = load(network.third[c]);
    Vector sum = hn::Mul(row.v[0], second.v[0]);
    for (int i = 1; i < kVectors; ++i) sum = hn::MulAdd(row.v[i], second.v[i], sum);
    a.output[c] = hn::GetLane(hn::SumOfLanes(d, sum)) + network.third[3][c];
  }
  const Vector one = hn::Set(d, 1.0f),
               x = hn::Max(hn::Load(d, a.output), hn::Set(d, -80.0f));  // Exp is not defined beyond this
  hn::Store(hn::Div(one, hn::Add(one, hn::Exp(d, hn::Neg(x)))), d, a.output);
}

// Loads segment s into a.input. The segments of a ray are consecutive: `ray` is the ray whose direction a.input already
// contains.
template <class Arguments>
HWY_INLINE void loadInput(const Arguments& arguments, size_t s, uint32_t& ray, Activations& a) {
  std::memcpy(a.input, hostPointer(arguments.composited) + kComposited * s, sizeof(float) * kComposited);
  const uint32_t next = hostPointer(arguments.rayOfSegment)[s];
  if (next != ray) encodeDirection(hostPointer(arguments.directions) + size_t{3} * next, a.input + kComposited);
  ray = next;
}

void forwardSegments(const DeferredForward& arguments, const PackedNetwork* networks, size_t begin, size_t end) {
  const uint32_t* networkOfSegment = hostPointer(arguments.networkOfSegment);
  float* specular = hostPointer(arguments.specular);
  Activations a{};
  uint32_t ray = ~0u;
  for (size_t s = begin; s < end; ++s) {
    loadInput(arguments, s, ray, a);
    throughNetwork(networks[networkOfSegment[s]].forward, a);
    std::memcpy(specular + 3 * s, a.output, sizeof(float) * 3);
  }
}

// rows[i] += factors[i] · gradient; the biases, in the row after them, += gradient.
template <int kCount>
HWY_INLINE void addOuter(const float* factors, const Units& gradient, float (*rows)[kUnits]) {
  for (int k = 0; k < kCount; ++k) store(multiplyAdd(factors[k], gradient, load(rows[k])), rows[k]);
  store(multiplyAdd(1, gradient, load(rows[kCount])), rows[kCount]);
}

void backwardSegments(const DeferredBackward& arguments, const PackedNetwork* networks, size_t begin, size_t end,
                      UnitRows* networkGradients) {
  const uint32_t* networkOfSegment = hostPointer(arguments.networkOfSegment);
  const float* specularGradients = hostPointer(arguments.specularGradients);
  float* compositedGradients = hostPointer(arguments.compositedGradients);
  Activations a{};
  alignas(128) float below[kUnits];
  uint32_t ray = ~0u;
  for (size_t s = begin; s < end; ++s) {
    const PackedNetwork& network = networks[networkOfSegment[s]];
    UnitRows& sums = networkGradients[networkOfSegment[s]];
    loadInput(arguments, s, ray, a);
    throughNetwork(network.forward, a);
    Units gradient = zeroUnits();
    const Units second = load(a.second);
    for (int c = 0; c < 3; ++c) {
      const float g = specularGradients[3 * s + c] * a.output[c] * (1 - a.output[c]);
      gradient = multiplyAdd(g, load(network.forward.third[c]), gradient);
      store(multiplyAdd(g, second, load(sums.third[c])), sums.third[c]);
      sums.third[3][c] += g;
    }
    gradient = whereActive(a.second, gradient);
    addOuter<kUnits>(a.first, gradient, sums.second);
    store(gradient, below);
    gradient = whereActive(a.first, combination<kUnits>(below, network.toUnits, zeroUnits()));
    addOuter<kInputs>(a.input, gradient, sums.first);
    store(gradient, below);
    store(combination<kUnits>(below, network.toComposited, zeroUnits()), below);
    for (int i = 0; i < kComposited; ++i) compositedGradients[kComposited * s + i] += below[i];
  }
}

}  // namespace tessera::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace tessera::cpu {

HWY_EXPORT(forwardSegments);
HWY_EXPORT(backwardSegments);

namespace {

constexpr size_t kSegmentsPerTask = 512;

std::vector<PackedNetwork> packNetworks(const Slice<const float>& parameters) {
  const size_t networks = parameters.count / DeferredNetwork::kParameters;
  std::vector<PackedNetwork> packed(networks);
  for (size_t n = 0; n < networks; ++n) {
    const float* from = hostPointer(parameters) + n * DeferredNetwork::kParameters;
    PackedNetwork& to = packed[n];
    for (int o = 0; o < kUnits; ++o) {
      for (int i = 0; i < kInputs; ++i) to.forward.first[i][o] = from[o * kInputs + i];
      for (int i = 0; i < kComposited; ++i) to.toComposited[o][i] = from[o * kInputs + i];
      to.forward.first[kInputs][o] = from[kUnits * kInputs + o];
    }
    from += DeferredNetwork::kWeights[1];
    for (int o = 0; o < kUnits; ++o) {
      for (int i = 0; i < kUnits; ++i) to.forward.second[i][o] = to.toUnits[o][i] = from[o * kUnits + i];
      to.forward.second[kUnits][o] = from[kUnits * kUnits + o];
    }
    from += DeferredNetwork::kWeights[2] - DeferredNetwork::kWeights[1];
    for (int c = 0; c < 3; ++c) {
      for (int i = 0; i < kUnits; ++i) to.forward.third[c][i] = from[c * kUnits + i];
      to.forward.third[3][c] = from[3 * kUnits + c];
    }
  }
  return packed;
}

void addUnpacked(const UnitRows& from, float* to) {
  for (int o = 0; o < kUnits; ++o) {
    for (int i = 0; i < kInputs; ++i) to[o * kInputs + i] += from.first[i][o];
    to[kUnits * kInputs + o] += from.first[kInputs][o];
  }
  to += DeferredNetwork::kWeights[1];
  for (int o = 0; o < kUnits; ++o) {
    for (int i = 0; i < kUnits; ++i) to[o * kUnits + i] += from.second[i][o];
    to[kUnits * kUnits + o] += from.second[kUnits][o];
  }
  to += DeferredNetwork::kWeights[2] - DeferredNetwork::kWeights[1];
  for (int c = 0; c < 3; ++c) {
    for (int i = 0; i < kUnits; ++i) to[c * kUnits + i] += from.third[c][i];
    to[3 * kUnits + c] += from.third[3][c];
  }
}

// Reused between calls, because fresh pages would cost more than filling them.
UnitRows* partialGradients(size_t count) {
  thread_local std::vector<UnitRows> partial;
  if (partial.size() < count) partial.resize(count);
  return partial.data();
}

}  // namespace

void run(Context& context, const DeferredForward& a) {
  const std::vector<PackedNetwork> networks = packNetworks(a.networks);
  const auto segments = HWY_DYNAMIC_DISPATCH(forwardSegments);
  context.pool.forRanges(hostCount(a.segments), kSegmentsPerTask,
                         [&](size_t begin, size_t end) { segments(a, networks.data(), begin, end); });
}

void run(Context& context, const DeferredBackward& a) {
  const size_t n = hostCount(a.segments);
  if (n == 0) return;
  const std::vector<PackedNetwork> networks = packNetworks(a.networks);
  UnitRows* partial = partialGradients(kParts * networks.size());
  const auto segments = HWY_DYNAMIC_DISPATCH(backwardSegments);
  context.pool.run(kParts, [&](size_t part, int) {
    UnitRows* gradients = partial + part * networks.size();
    std::memset(gradients, 0, sizeof(UnitRows) * networks.size());
    segments(a, networks.data(), part * n / kParts, (part + 1) * n / kParts, gradients);
  });
  float* sums = hostPointer(a.networkGradients);
  context.pool.run(networks.size(), [&](size_t network, int) {
    for (size_t part = 0; part < kParts; ++part) {
      addUnpacked(partial[part * networks.size() + network], sums + network * DeferredNetwork::kParameters);
    }
  });
}

}  // namespace tessera::cpu
#endif

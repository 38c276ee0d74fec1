// Measures the peak rates of this machine with code like that of the kernels: the limits for `tessera bench compute`.

#include <algorithm>
#include <chrono>
#include <cstring>
#include <numeric>
#include <vector>

#include "base/check.h"
#include "base/random.h"
#include "compute/cpu/kernels.h"
#include "compute/cpu/simd_targets.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "compute/cpu/rates.cpp"
#include <hwy/foreach_target.h>
// after foreach_target
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace tessera::cpu::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

const char* targetName() {
  return hwy::TargetName(HWY_TARGET);
}

// Returns the number of multiply-adds over all lanes; writes the result to `sink` so that nothing is optimised away.
size_t multiplyAdds(size_t rounds, float* sink) {
  const hn::CappedTag<float, 16> d;
  constexpr int kChains = 12;
  hn::Vec<decltype(d)> sum[kChains];
  for (int i = 0; i < kChains; ++i) sum[i] = hn::Set(d, static_cast<float>(i));
  const auto a = hn::Set(d, 0.999f), b = hn::Set(d, 1e-3f);
  for (size_t r = 0; r < rounds; ++r) {
    for (int i = 0; i < kChains; ++i) sum[i] = hn::MulAdd(sum[i], a, b);
  }
  for (int i = 0; i < kChains; ++i) *sink += hn::GetLane(sum[i]);
  return rounds * kChains * hn::Lanes(d);
}

}  // namespace tessera::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace tessera::cpu {

HWY_EXPORT(targetName);
HWY_EXPORT(multiplyAdds);

namespace {

double seconds(const std::function<void()>& work) {
  const auto start = std::chrono::steady_clock::now();
  work();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

// The best rate of several runs, so that disturbances by other processes do not count.
double bestRate(double amount, const std::function<void()>& work) {
  double best = 1e30;
  for (int i = 0; i < 7; ++i) best = std::min(best, seconds(work));
  return amount / best;
}

}  // namespace

const char* simdTarget() {
  return HWY_DYNAMIC_DISPATCH(targetName)();
}

std::vector<std::string> simdTargets() {
  std::vector<std::string> names;
  for (const int64_t target : hwy::SupportedAndGeneratedTargets()) names.emplace_back(hwy::TargetName(target));
  return names;
}

void useSimdTarget(const std::string& name) {
  hwy::SetSupportedTargetsForTest(0);
  if (name.empty()) return;
  int64_t chosen = 0;
  for (const int64_t target : hwy::SupportedAndGeneratedTargets()) {
    if (name == hwy::TargetName(target)) chosen = target;
  }
  CHECK(chosen != 0);
  hwy::SetSupportedTargetsForTest(chosen);
}

double peakFlops(ThreadPool& pool) {
  const size_t threads = pool.threads();
  std::vector<float> sinks(threads * 32);
  constexpr size_t kRounds = 4'000'000;
  const auto kernel = HWY_DYNAMIC_DISPATCH(multiplyAdds);
  size_t each = 0;
  const auto work = [&] {
    pool.run(threads, [&](size_t task, int) {
      const size_t done = kernel(kRounds, &sinks[task * 32]);
      if (task == 0) each = done;
    });
  };
  work();
  return bestRate(2.0 * static_cast<double>(each * threads), work);
}

double gatherRate(ThreadPool& pool, size_t bytes, int tables) {
  const size_t entries = bytes / 8;
  constexpr size_t kLoads = 1 << 19, kTask = 1 << 15;
  std::vector<uint64_t> table(entries * tables, 1);
  std::vector<uint32_t> index(kLoads);
  const RandomStream random(1, 2);
  for (size_t i = 0; i < kLoads; ++i) index[i] = random.below(i, static_cast<uint32_t>(entries));
  std::vector<uint64_t> sinks(tables * kLoads / kTask);
  const size_t perTable = kLoads / kTask;
  const auto work = [&] {
    pool.run(tables * perTable, [&](size_t task, int) {
      const uint64_t* from = table.data() + task / perTable * entries;
      const uint32_t* at = index.data() + task % perTable * kTask;
      // Four independent sums, so that loads do not wait for each other.
      uint64_t sum[4] = {0, 0, 0, 0};
      for (size_t i = 0; i < kTask; i += 4) {
        for (size_t k = 0; k < 4; ++k) sum[k] += from[at[i + k]];
      }
      sinks[task] = sum[0] + sum[1] + sum[2] + sum[3];
    });
  };
  work();
  return bestRate(static_cast<double>(kLoads) * tables, work);
}

double streamRate(ThreadPool& pool, size_t bytes) {
  const size_t half = bytes / 2, threads = pool.threads();
  // At least a millisecond of work per measurement; each thread copies its own part, so that data that fits stays in
  // its cache.
  const size_t part = (half + threads - 1) / threads, rounds = std::max<size_t>(1, (size_t{1} << 26) / bytes);
  std::vector<char> from(half, 1), to(half, 2);
  const auto work = [&] {
    pool.run(threads, [&](size_t task, int) {
      const size_t begin = std::min(half, task * part), end = std::min(half, begin + part);
      for (size_t i = 0; i < rounds; ++i) {
        std::memcpy(to.data() + begin, from.data() + begin, end - begin);
        asm volatile("" : : "r"(to.data()) : "memory");  // keeps the compiler from omitting rounds
      }
    });
  };
  work();
  return bestRate(2.0 * static_cast<double>(half * rounds), work);
}

}  // namespace tessera::cpu
#endif

#include "compute/proposals.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

#include "compute/cpu/kernels.h"
#include "compute/host_memory.h"

namespace tessera::cpu {
namespace {

constexpr size_t kRaysPerTask = 64;  // fixed: partial sums are added in task order

// Sets share[j] = w_j^anneal; returns the sum.
double annealedShares(const float* weights, uint32_t count, float anneal, float* share) {
  if (anneal == 1) {
    std::copy(weights, weights + count, share);
  } else if (anneal == 0) {
    std::fill(share, share + count, 1.0f);
  } else {
    for (uint32_t j = 0; j < count; ++j) share[j] = std::pow(weights[j], anneal);
  }
  return std::accumulate(share, share + count, 0.0);
}

// Inverts the cumulative distribution, which rises from cumulative[0] = 0 to cumulative[before] = 1 over `fences`, at
// u_i = (i + jitter - ½) / after. The bin of a new fence is the last that begins at or before it: each bin marks the
// first new fence after its beginning, and each fence uses the last mark so far, which avoids unpredictable branches.
// `bins` has space for after + 2 elements.
void invert(const ResampleFences& a, const float* fences, const double* cumulative, double jitter, uint32_t* bins,
            float* resampled) {
  const double posts = a.after, perPost = 1 / posts, offset = jitter - 0.5;
  std::fill(bins, bins + a.after + 2, 0);
  for (uint32_t j = 1; j < a.before; ++j) {
    const double place = std::ceil(cumulative[j] * posts - offset);  // in (-1, after + 1]
    bins[static_cast<uint32_t>(static_cast<int32_t>(std::max(0.0, place)))] = j;
  }
  uint32_t bin = 0;
  resampled[0] = fences[0];
  resampled[a.after] = fences[a.before];
  bin = bins[0];
  for (uint32_t i = 1; i < a.after; ++i) {
    bin = std::max(bin, bins[i]);
    const double begin = cumulative[bin], width = cumulative[bin + 1] - begin, into = (i + offset) * perPost - begin;
    const double along = width > 0 ? std::min(1.0, std::max(0.0, into / width)) : 0;
    resampled[i] = static_cast<float>(fences[bin] + along * (static_cast<double>(fences[bin + 1]) - fences[bin]));
  }
}

// One ray of InterlevelLoss, unscaled. `sums` and `slopes` have space for intervals + 1 elements.
double interlevelLossOfRay(const InterlevelLoss& a, size_t ray, double* sums, double* slopes) {
  const uint32_t bins = a.intervals;
  const float* fences = hostPointer(a.fences) + ray * (bins + size_t{1});
  const float* weights = hostPointer(a.weights) + ray * bins;
  const float* middles = hostPointer(a.middles);
  const float* widths = hostPointer(a.widths);
  const float* sampleWeights = hostPointer(a.sampleWeights);
  float* gradients = hostPointer(a.weightGradients) + ray * bins;
  sums[0] = 0;
  for (uint32_t j = 0; j < bins; ++j) sums[j + 1] = sums[j] + weights[j];
  std::fill(slopes, slopes + bins + 1, 0.0);  // differences of the gradient between consecutive bins
  double loss = 0;
  uint32_t first = 0, end = 1;  // bins of the current sample; they only move forward
  for (uint32_t i = hostPointer(a.firstSample)[ray]; i < hostPointer(a.firstSample)[ray + 1]; ++i) {
    const double half = 0.5 * widths[i], from = middles[i] - half, to = middles[i] + half, weight = sampleWeights[i];
    while (first + 1 < bins && fences[first + 1] <= from) ++first;
    while (first > 0 && fences[first] > from) --first;
    end = std::max(end, first + 1);
    while (end < bins && fences[end] <= to) ++end;
    while (end > first + 1 && fences[end - 1] > to) --end;
    const double excess = weight - (sums[end] - sums[first]);
    if (!(excess > 0)) continue;
    const double share = excess / (weight + 1e-7);
    loss += excess * share;
    slopes[first] -= 2 * share;
    slopes[end] += 2 * share;
  }
  double slope = 0;
  for (uint32_t j = 0; j < bins; ++j) {
    slope += slopes[j];
    gradients[j] = static_cast<float>(a.scale * slope);
  }
  return loss;
}

}  // namespace

void run(Context& context, const ResampleFences& a) {
  const float* fences = hostPointer(a.fences);
  const float* weights = hostPointer(a.weights);
  const float* jitter = hostPointer(a.jitter);
  float* resampled = hostPointer(a.resampled);
  const size_t rays = hostCount(a.rays), tasks = (rays + kRaysPerTask - 1) / kRaysPerTask;
  context.pool.run(tasks, [&](size_t task, int) {
    std::vector<float> share(a.before);
    std::vector<double> cumulative(a.before + size_t{1});
    std::vector<uint32_t> bins(a.after + size_t{2});
    for (size_t ray = task * kRaysPerTask; ray < std::min(rays, (task + 1) * kRaysPerTask); ++ray) {
      const double sum = annealedShares(weights + ray * a.before, a.before, a.anneal, share.data());
      const double even = 1.0 / a.before, minimum = sum > 0 ? a.uniformFraction * even : even;
      const double perShare = sum > 0 ? (1.0 - a.uniformFraction) / sum : 0;
      double reached = 0;
      for (uint32_t j = 1; j < a.before; ++j) {
        reached += perShare * share[j - 1] + minimum;
        cumulative[j] = std::min(1.0, reached);
      }
      cumulative[a.before] = 1;
      invert(a, fences + ray * (a.before + size_t{1}), cumulative.data(), jitter ? jitter[ray] : 0.5, bins.data(),
             resampled + ray * (a.after + size_t{1}));
    }
  });
}

void run(Context& context, const InterlevelLoss& a) {
  const size_t rays = hostCount(a.rays), tasks = (rays + kRaysPerTask - 1) / kRaysPerTask;
  std::vector<double> losses(tasks);
  context.pool.run(tasks, [&](size_t task, int) {
    std::vector<double> sums(a.intervals + size_t{1}), slopes(a.intervals + size_t{1});
    for (size_t ray = task * kRaysPerTask; ray < std::min(rays, (task + 1) * kRaysPerTask); ++ray) {
      losses[task] += interlevelLossOfRay(a, ray, sums.data(), slopes.data());
    }
  });
  *hostPointer(a.loss) = static_cast<float>(a.scale * std::accumulate(losses.begin(), losses.end(), 0.0));
}

}  // namespace tessera::cpu

#include "compute/proposals.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "compute/reference/convert.h"
#include "compute/reference/functions.h"

namespace tessera::reference {

Doubles resampledFences(View fences, View weights, uint32_t after, double anneal, double uniformFraction,
                        double jitter) {
  const size_t before = weights.size();
  Doubles share;
  for (double weight : weights) share.push_back(std::pow(weight, anneal));
  const double sum = std::accumulate(share.begin(), share.end(), 0.0);
  Doubles cumulative{0};
  for (double s : share) {
    const double p =
        sum > 0 ? (1 - uniformFraction) * s / sum + uniformFraction / static_cast<double>(before) : 1.0 / before;
    cumulative.push_back(std::min(1.0, cumulative.back() + p));
  }
  cumulative.back() = 1;
  Doubles resampled{fences.front()};
  for (uint32_t i = 1; i < after; ++i) {
    const double u = (i + jitter - 0.5) / after;
    // Finds the last bin that begins at or before u.
    const auto next = std::upper_bound(cumulative.begin(), cumulative.end() - 1, u);
    const size_t bin = static_cast<size_t>(next - cumulative.begin()) - 1;
    const double along = (u - cumulative[bin]) / (cumulative[bin + 1] - cumulative[bin]);
    resampled.push_back(fences[bin] + along * (fences[bin + 1] - fences[bin]));
  }
  resampled.push_back(fences.back());
  return resampled;
}

LossAndGradients interlevelLossOfRay(View fences, View weights, View middles, View widths, View sampleWeights) {
  LossAndGradients result{0, Doubles(weights.size())};
  const auto last = static_cast<std::ptrdiff_t>(weights.size());
  for (size_t i = 0; i < middles.size(); ++i) {
    const double from = middles[i] - widths[i] / 2, to = middles[i] + widths[i] / 2;
    const auto fenceAfter = [&](double s) {
      return std::upper_bound(fences.begin(), fences.end(), s) - fences.begin();
    };
    const std::ptrdiff_t first = std::clamp<std::ptrdiff_t>(fenceAfter(from) - 1, 0, last - 1);
    const std::ptrdiff_t end = std::clamp<std::ptrdiff_t>(fenceAfter(to), first + 1, last);
    const double bound = std::accumulate(weights.begin() + first, weights.begin() + end, 0.0);
    const double excess = std::max(0.0, sampleWeights[i] - bound);
    result.loss += excess * excess / (sampleWeights[i] + 1e-7);
    for (std::ptrdiff_t bin = first; bin < end; ++bin) result.gradients[bin] -= 2 * excess / (sampleWeights[i] + 1e-7);
  }
  return result;
}

void run(const ResampleFences& a) {
  const size_t rays = hostCount(a.rays), posts = a.before + size_t{1};
  const Doubles fences = doubles(a.fences, posts * rays), weights = doubles(a.weights, a.before * rays);
  const Doubles jitter = doubles(a.jitter, rays);
  Doubles resampled;
  for (size_t r = 0; r < rays; ++r) {
    const Doubles ofRay =
        resampledFences(View(fences).subspan(posts * r, posts), View(weights).subspan(a.before * r, a.before), a.after,
                        a.anneal, a.uniformFraction, jitter.empty() ? 0.5 : jitter[r]);
    resampled.insert(resampled.end(), ofRay.begin(), ofRay.end());
  }
  store(a.resampled, resampled);
}

void run(const InterlevelLoss& a) {
  const size_t rays = hostCount(a.rays), posts = a.intervals + size_t{1};
  const Doubles fences = doubles(a.fences, posts * rays), weights = doubles(a.weights, a.intervals * rays);
  const Indices firstSample = indices(a.firstSample, rays + 1);
  const size_t samples = firstSample[rays];
  const Doubles middles = doubles(a.middles, samples), widths = doubles(a.widths, samples);
  const Doubles sampleWeights = doubles(a.sampleWeights, samples);
  Doubles loss(1), gradients;
  for (size_t r = 0; r < rays; ++r) {
    const size_t first = firstSample[r], count = firstSample[r + 1] - first;
    const LossAndGradients ray =
        interlevelLossOfRay(View(fences).subspan(posts * r, posts), View(weights).subspan(a.intervals * r, a.intervals),
                            View(middles).subspan(first, count), View(widths).subspan(first, count),
                            View(sampleWeights).subspan(first, count));
    loss[0] += a.scale * ray.loss;
    for (double g : ray.gradients) gradients.push_back(a.scale * g);
  }
  store(a.loss, loss);
  store(a.weightGradients, gradients);
}

}  // namespace tessera::reference

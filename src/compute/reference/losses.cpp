#include "compute/losses.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "base/random.h"
#include "compute/reference/convert.h"
#include "compute/reference/functions.h"

namespace tessera::reference {
namespace {

// Σ_ij w_i w_j |s_i - s_j| + Σ_i w_i² Δ_i / 3 over the bins [from, to].
LossAndGradients distortionOfBins(View weights, View from, View to) {
  const size_t n = weights.size();
  LossAndGradients result{0, Doubles(n)};
  for (size_t i = 0; i < n; ++i) {
    const double width = to[i] - from[i];
    result.loss += weights[i] * weights[i] * width / 3;
    result.gradients[i] += 2 * weights[i] * width / 3;
    for (size_t j = 0; j < n; ++j) {
      const double apart = std::abs((from[i] + to[i]) / 2 - (from[j] + to[j]) / 2);
      result.loss += weights[i] * weights[j] * apart;
      result.gradients[i] += 2 * weights[j] * apart;
    }
  }
  return result;
}

}  // namespace

ValueAndSlope colourLoss(ColourLossKind kind, double parameter, double r) {
  switch (kind) {
    case ColourLossKind::mse:
      return {r * r, 2 * r};
    case ColourLossKind::huber:
      if (std::abs(r) <= parameter) return {r * r / (2 * parameter), r / parameter};
      return {std::abs(r) - parameter / 2, std::copysign(1, r)};
    case ColourLossKind::charbonnier: {
      const double root = std::sqrt(r * r + parameter * parameter);
      return {root, root > 0 ? r / root : 0};
    }
  }
  return {};
}

double warpDistance(double t) {
  return t < 1 ? t / 2 : 1 - 1 / (2 * t);
}

LossAndGradients distortionOfFences(View fences, View weights) {
  return distortionOfBins(weights, fences.first(weights.size()), fences.subspan(1));
}

LossAndGradients distortionOfRay(View weights, View distances, View steps, bool normalised) {
  Doubles from, to;
  for (size_t i = 0; i < weights.size(); ++i) {
    const double begin = distances[i] - steps[i] / 2, end = distances[i] + steps[i] / 2;
    from.push_back(normalised ? begin : warpDistance(begin));
    to.push_back(normalised ? end : warpDistance(end));
  }
  return distortionOfBins(weights, from, to);
}

LossAndGradients depthLossOfRay(double known, double tolerance, View weights, View distances) {
  LossAndGradients result{0, Doubles(weights.size())};
  if (known <= 0) return result;
  result.loss = 1;
  for (size_t i = 0; i < weights.size(); ++i) {
    const double r = std::min(1.0, std::max(0.0, std::abs(distances[i] - known) / known - tolerance));
    result.loss -= weights[i] * (1 - r);
    result.gradients[i] = r - 1;
  }
  return result;
}

std::vector<uint32_t> s3imOrder(uint32_t rays, uint32_t patch, uint64_t seed) {
  std::vector<uint32_t> order(rays);
  std::iota(order.begin(), order.end(), 0u);
  if (patch == 0) return order;
  const RandomStream random(mix64(seed) + patch, 0x531);
  for (uint32_t i = rays; i-- > 1;) std::swap(order[i], order[random.below(i, i + 1)]);
  return order;
}

LossAndGradients ssimOfGroup(const double x[16], const double y[16]) {
  constexpr double kTaps[4] = {.136465, .265797, .331941, .265797}, kC1 = 1e-4, kC2 = 9e-4;
  const auto weight = [&](int p) { return kTaps[p / 4] * kTaps[p % 4]; };
  double meanX = 0, meanY = 0, squares = 0, products = 0;
  for (int p = 0; p < 16; ++p) {
    meanX += weight(p) * x[p];
    meanY += weight(p) * y[p];
  }
  for (int p = 0; p < 16; ++p) {
    squares += weight(p) * ((x[p] - meanX) * (x[p] - meanX) + (y[p] - meanY) * (y[p] - meanY));
    products += weight(p) * (x[p] - meanX) * (y[p] - meanY);
  }
  const double a1 = 2 * meanX * meanY + kC1, a2 = 2 * products + kC2;
  const double b1 = meanX * meanX + meanY * meanY + kC1, b2 = squares + kC2;
  LossAndGradients similarity{a1 * a2 / (b1 * b2), Doubles(16)};
  for (int p = 0; p < 16; ++p)
    similarity.gradients[p] =
        2 * weight(p) *
        ((meanY * a2 + a1 * (y[p] - meanY)) / (b1 * b2) - similarity.loss * (meanX / b1 + (x[p] - meanX) / b2));
  return similarity;
}

LossAndGradients s3imLoss(View predicted, View target, View weights, uint32_t patches, uint64_t seed) {
  const uint32_t rays = static_cast<uint32_t>(predicted.size() / 3), groups = rays / 16;
  LossAndGradients result{0, Doubles(predicted.size())};
  if (patches == 0 || groups == 0) return result;
  const double share = 1.0 / (3.0 * patches * groups);
  for (uint32_t patch = 0; patch < patches; ++patch) {
    const std::vector<uint32_t> order = s3imOrder(rays, patch, seed);
    for (uint32_t group = 0; group < groups; ++group)
      for (uint32_t c = 0; c < 3; ++c) {
        double x[16], y[16];
        for (uint32_t p = 0; p < 16; ++p) {
          const uint32_t ray = order[16 * group + p];
          x[p] = predicted[3 * ray + c];
          y[p] = !weights.empty() && weights[ray] == 0 ? x[p] : target[3 * ray + c];
        }
        const LossAndGradients similarity = ssimOfGroup(x, y);
        result.loss += share * (1 - similarity.loss);
        for (uint32_t p = 0; p < 16; ++p) {
          const uint32_t ray = order[16 * group + p];
          if (weights.empty() || weights[ray] != 0) result.gradients[3 * ray + c] -= share * similarity.gradients[p];
        }
      }
  }
  return result;
}

ValueAndSlope opacityLoss(double opacity) {
  const double alpha = std::clamp(opacity, 1e-5, 1 - 1e-5);
  return {-(alpha * std::log(alpha) + (1 - alpha) * std::log(1 - alpha)), std::log((1 - alpha) / alpha)};
}

ValueAndSlope sparsityLoss(double logDensity, double runtimeStep) {
  const double opticalDepth = std::exp(logDensity) * runtimeStep;
  return {-std::expm1(-opticalDepth),
          std::exp(-opticalDepth) * runtimeStep * std::exp(std::clamp(logDensity, -15.0, 15.0))};
}

double ditherLossOfRay(View weights, View colours, const Point& colour, double opacity, const Point& background) {
  double loss = 0;
  for (size_t i = 0; i < colours.size(); ++i) loss += weights[i / 3] * colours[i] * colours[i];
  for (size_t c = 0; c < 3; ++c) loss += (1 - opacity) * background[c] * background[c] - colour[c] * colour[c];
  return loss;
}

void run(const ColourLoss& a) {
  const size_t rays = hostCount(a.rays);
  const Doubles predicted = doubles(a.predicted, 3 * rays), target = doubles(a.target, 3 * rays);
  const Doubles weights = doubles(a.weights, rays);
  Doubles loss(2), gradients;
  for (size_t i = 0; i < 3 * rays; ++i) {
    const double weight = weights.empty() ? 1 : weights[i / 3], residual = predicted[i] - target[i];
    const ValueAndSlope f = colourLoss(a.kind, a.parameter, residual);
    loss[0] += a.scale * weight * f.value;
    loss[1] += weight * residual * residual;
    gradients.push_back(a.scale * weight * f.slope);
  }
  store(a.loss, loss);
  store(a.gradients, gradients);
}

void run(const DistortionLoss& a) {
  const size_t rays = hostCount(a.rays);
  const Indices firstSample = indices(a.firstSample, rays + 1);
  const size_t samples = firstSample[rays];
  const Doubles weights = doubles(a.weights, samples), distances = doubles(a.distances, samples);
  const Doubles steps = doubles(a.steps, samples);
  Doubles loss(1), gradients;
  for (size_t r = 0; r < rays; ++r) {
    const size_t first = firstSample[r], count = firstSample[r + 1] - first;
    const LossAndGradients ray =
        distortionOfRay(View(weights).subspan(first, count), View(distances).subspan(first, count),
                        View(steps).subspan(first, count), a.normalised);
    loss[0] += a.scale * ray.loss;
    for (double g : ray.gradients) gradients.push_back(a.scale * g);
  }
  store(a.loss, loss);
  store(a.weightGradients, gradients);
}

void run(const DepthLoss& a) {
  const size_t rays = hostCount(a.rays);
  const Indices firstSample = indices(a.firstSample, rays + 1);
  const size_t samples = firstSample[rays];
  const Doubles weights = doubles(a.weights, samples), distances = doubles(a.distances, samples);
  const Doubles known = doubles(a.known, rays);
  Doubles loss(1), gradients;
  for (size_t r = 0; r < rays; ++r) {
    const size_t first = firstSample[r], count = firstSample[r + 1] - first;
    const LossAndGradients ray = depthLossOfRay(known[r], a.tolerance, View(weights).subspan(first, count),
                                                View(distances).subspan(first, count));
    loss[0] += a.scale * ray.loss;
    for (double g : ray.gradients) gradients.push_back(a.scale * g);
  }
  store(a.loss, loss);
  add(a.weightGradients, gradients);
}

void run(const S3imLoss& a) {
  const size_t rays = hostCount(a.rays);
  LossAndGradients all = s3imLoss(doubles(a.predicted, 3 * rays), doubles(a.target, 3 * rays), doubles(a.weights, rays),
                                  a.patches, a.seed);
  for (double& g : all.gradients) g *= a.scale;
  store(a.loss, Doubles{a.scale * all.loss});
  add(a.gradients, all.gradients);
}

void run(const OpacityLoss& a) {
  Doubles loss(1), gradients;
  for (double opacity : doubles(a.opacities, hostCount(a.segments))) {
    const ValueAndSlope f = opacityLoss(opacity);
    loss[0] += a.scale * f.value;
    gradients.push_back(a.scale * f.slope);
  }
  store(a.loss, loss);
  add(a.opacityGradients, gradients);
}

void run(const SparsityLoss& a) {
  const size_t points = hostCount(a.points);
  const Doubles logDensities = doubles(a.logDensities, points), steps = doubles(a.runtimeSteps, points);
  Doubles loss(1), gradients;
  for (size_t i = 0; i < points; ++i) {
    const ValueAndSlope f = sparsityLoss(logDensities[i], steps[i]);
    loss[0] += a.scale * f.value;
    gradients.push_back(a.scale * f.slope);
  }
  store(a.loss, loss);
  store(a.gradients, gradients);
}

void run(const DitherLoss& a) {
  const size_t rays = hostCount(a.rays);
  const Indices firstSample = indices(a.firstSample, rays + 1);
  const size_t samples = firstSample[rays];
  CHECK(a.colours.columns == 3u);
  CHECK(a.colourGradients.columns == 3u);
  const Doubles weights = doubles(a.weights, samples), colours = doubles(a.colours, samples);
  const Doubles rayWeights = doubles(a.rayWeights, rays), colour = doubles(a.colour, 3 * rays);
  const Doubles background = doubles(a.background, 3 * rays);
  const Doubles opacity = background.empty() ? Doubles() : doubles(a.opacity, rays);
  Doubles loss(1), weightGradients(samples), rayColourGradients(3 * rays), rayOpacityGradients(rays);
  Doubles colourGradients = doubles(Matrix<const float>(a.colourGradients), samples);
  for (size_t r = 0; r < rays; ++r) {
    const double scale = a.scale * (rayWeights.empty() ? 1 : rayWeights[r]);
    const size_t first = firstSample[r], count = firstSample[r + 1] - first;
    const Point of = {colour[3 * r], colour[3 * r + 1], colour[3 * r + 2]};
    Point behind{};
    if (!background.empty()) behind = {background[3 * r], background[3 * r + 1], background[3 * r + 2]};
    loss[0] += scale * ditherLossOfRay(View(weights).subspan(first, count), View(colours).subspan(3 * first, 3 * count),
                                       of, opacity.empty() ? 0 : opacity[r], behind);
    for (size_t i = 3 * first; i < 3 * (first + count); ++i) {
      weightGradients[i / 3] += scale * colours[i] * colours[i];
      colourGradients[i] += 2 * scale * weights[i / 3] * colours[i];
    }
    for (size_t c = 0; c < 3; ++c) {
      rayColourGradients[3 * r + c] = -2 * scale * of[c];
      rayOpacityGradients[r] -= scale * behind[c] * behind[c];
    }
  }
  store(a.loss, loss);
  store(a.weightGradients, weightGradients);
  store(a.colourGradients, colourGradients);
  add(a.rayColourGradients, rayColourGradients);
  if (a.background) add(a.rayOpacityGradients, rayOpacityGradients);
}

}  // namespace tessera::reference

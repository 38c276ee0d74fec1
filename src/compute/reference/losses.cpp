#include "compute/losses.h"

#include <cmath>

#include "compute/reference/convert.h"
#include "compute/reference/functions.h"
#include "compute/reference/operations.h"

namespace tessera::reference {
namespace {

// Σ_ij w_i w_j |s_i - s_j| + Σ_i w_i² Δ_i / 3, over bins [from, to].
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

LossAndGradients distortionOfRay(View weights, View distances, View steps) {
  Doubles from, to;
  for (size_t i = 0; i < weights.size(); ++i) {
    from.push_back(warpDistance(distances[i] - steps[i] / 2));
    to.push_back(warpDistance(distances[i] + steps[i] / 2));
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
    const LossAndGradients ray = distortionOfRay(
        View(weights).subspan(first, count), View(distances).subspan(first, count), View(steps).subspan(first, count));
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

void run(const ExposureForward& a) {
  const size_t rays = hostCount(a.rays);
  const Indices photoOfRay = indices(a.photoOfRay, rays);
  const Doubles logGains = doubles(a.logGains, a.logGains.count);
  const Doubles opacity = doubles(a.opacity, a.background ? rays : 0), background = doubles(a.background, 3 * rays);
  Doubles exposed = doubles(a.colours, 3 * rays);
  for (size_t i = 0; i < 3 * rays; ++i) {
    exposed[i] *= std::exp2(logGains[3 * photoOfRay[i / 3] + i % 3]);
    if (a.background) exposed[i] += (1 - opacity[i / 3]) * background[i];
  }
  store(a.exposed, exposed);
}

void run(const ExposureBackward& a) {
  const size_t rays = hostCount(a.rays);
  const Indices photoOfRay = indices(a.photoOfRay, rays);
  const Doubles logGains = doubles(a.logGains, a.logGains.count), colours = doubles(a.colours, 3 * rays);
  const Doubles background = doubles(a.background, 3 * rays);
  Doubles gradients = doubles(a.exposedGradients, 3 * rays), gainGradients(a.logGains.count), opacityGradients(rays);
  for (size_t i = 0; i < 3 * rays; ++i) {
    if (a.background) opacityGradients[i / 3] -= gradients[i] * background[i];
    const size_t gain = 3 * photoOfRay[i / 3] + i % 3;
    gradients[i] *= std::exp2(logGains[gain]);
    gainGradients[gain] += gradients[i] * colours[i] * std::log(2.0);
  }
  store(a.colourGradients, gradients);
  if (a.background) store(a.opacityGradients, opacityGradients);
  add(a.logGainGradients, gainGradients);
}

}  // namespace tessera::reference

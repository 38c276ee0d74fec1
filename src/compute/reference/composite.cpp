#include "compute/composite.h"

#include <algorithm>
#include <cmath>

#include "compute/reference/convert.h"
#include "compute/reference/functions.h"

namespace tessera::reference {

double computeOpacity(Extinction extinction, double x, double step) {
  switch (extinction) {
    case Extinction::opacity:
      return x;
    case Extinction::density:
      return -std::expm1(-x * step);
    case Extinction::logDensity:
      return -std::expm1(-std::exp(x) * step);
  }
  return 0;
}

RayColour compositeRay(Extinction extinction, double minTransmittance, const RaySamples& samples) {
  RayColour ray;
  ray.colour.resize(samples.columns);
  ray.weights.resize(samples.x.size());
  double transmittance = 1;
  for (size_t i = 0; i < samples.x.size() && transmittance >= minTransmittance; ++i) {
    const double alpha = computeOpacity(extinction, samples.x[i], samples.steps.empty() ? 0 : samples.steps[i]);
    const double weight = transmittance * alpha;
    ray.weights[i] = weight;
    for (size_t c = 0; c < samples.columns; ++c) ray.colour[c] += weight * samples.colours[samples.columns * i + c];
    if (!samples.distances.empty()) ray.depth += weight * samples.distances[i];
    transmittance *= 1 - alpha;
  }
  for (size_t c = 0; c < samples.background.size(); ++c) ray.colour[c] += transmittance * samples.background[c];
  ray.opacity = 1 - transmittance;
  return ray;
}

RayGradients compositeRayBackward(Extinction extinction, double minTransmittance, const RaySamples& samples,
                                  const Doubles& colourGradient, double opacityGradient, double depthGradient,
                                  View weightGradients) {
  const size_t all = samples.x.size(), columns = samples.columns;
  RayGradients gradients{Doubles(all), Doubles(columns * all)};
  Doubles alphas, before;  // opacity of each sample, transmittance in front of it
  double transmittance = 1;
  while (alphas.size() < all && transmittance >= minTransmittance) {
    const size_t i = alphas.size();
    before.push_back(transmittance);
    alphas.push_back(computeOpacity(extinction, samples.x[i], samples.steps.empty() ? 0 : samples.steps[i]));
    transmittance *= 1 - alphas[i];
  }
  // The derivative of the loss with respect to the light arriving from behind sample i. Opacity is 1 - T.
  double rear = -opacityGradient;
  for (size_t c = 0; c < samples.background.size(); ++c) rear += colourGradient[c] * samples.background[c];
  for (size_t i = alphas.size(); i-- > 0;) {
    double worth = weightGradients.empty() ? 0 : weightGradients[i];  // ∂L/∂w_i
    if (depthGradient != 0) worth += depthGradient * samples.distances[i];
    for (size_t c = 0; c < columns; ++c) {
      worth += colourGradient[c] * samples.colours[columns * i + c];
      gradients.colours[columns * i + c] = before[i] * alphas[i] * colourGradient[c];
    }
    double slope = 1;  // ∂α/∂x
    if (extinction == Extinction::density) slope = (1 - alphas[i]) * samples.steps[i];
    if (extinction == Extinction::logDensity)
      slope = (1 - alphas[i]) * samples.steps[i] * std::exp(std::clamp(samples.x[i], -15.0, 15.0));
    gradients.x[i] = before[i] * (worth - rear) * slope;
    rear = alphas[i] * worth + (1 - alphas[i]) * rear;
  }
  return gradients;
}

namespace {

// Owns the samples of all rays.
struct AllSamples {
  Indices firstSample;
  Doubles x, steps, distances, colours, background;
  size_t columns;

  template <class Arguments>
  explicit AllSamples(const Arguments& a) {
    const size_t rays = hostCount(a.rays);
    firstSample = indices(a.firstSample, rays + 1);
    const size_t samples = firstSample[rays];
    x = doubles(a.x, samples);
    if (a.extinction != Extinction::opacity) steps = doubles(a.steps, samples);
    distances = doubles(a.distances, samples);
    columns = a.colours.columns;
    CHECK(columns <= 16u);
    colours = doubles(a.colours, samples);
    background = doubles(a.background, columns * rays);
  }
  RaySamples ofRay(size_t ray) const {
    const size_t first = firstSample[ray], count = firstSample[ray + 1] - first;
    RaySamples samples;
    samples.x = View(x).subspan(first, count);
    if (!steps.empty()) samples.steps = View(steps).subspan(first, count);
    if (!distances.empty()) samples.distances = View(distances).subspan(first, count);
    samples.columns = columns;
    samples.colours = View(colours).subspan(columns * first, columns * count);
    if (!background.empty()) samples.background = row(background, ray);
    return samples;
  }
  Doubles row(const Doubles& values, size_t ray) const {  // of [rays][columns]
    return Doubles(values.begin() + columns * ray, values.begin() + columns * (ray + 1));
  }
};

}  // namespace

void run(const CompositeForward& a) {
  const size_t rays = hostCount(a.rays);
  const AllSamples all(a);
  Doubles colour, opacity, depth;
  for (size_t r = 0; r < rays; ++r) {
    const RayColour ray = compositeRay(a.extinction, a.minTransmittance, all.ofRay(r));
    colour.insert(colour.end(), ray.colour.begin(), ray.colour.end());
    opacity.push_back(ray.opacity);
    depth.push_back(ray.depth);
    if (!ray.weights.empty()) store(a.weights.part(all.firstSample[r], ray.weights.size()), ray.weights);
  }
  store(a.colour, colour);
  store(a.opacity, opacity);
  store(a.depth, depth);
}

void run(const CompositeBackward& a) {
  const size_t rays = hostCount(a.rays);
  const AllSamples all(a);
  const size_t columns = all.columns;
  const Doubles colourGradients = doubles(a.rayColourGradients, columns * rays);
  const Doubles opacityGradients = doubles(a.rayOpacityGradients, rays);
  const Doubles depthGradients = doubles(a.rayDepthGradients, rays);
  const Doubles weightGradients = doubles(a.weightGradients, all.firstSample[rays]);
  Doubles x(all.firstSample[rays]), colours(columns * x.size());
  for (size_t r = 0; r < rays; ++r) {
    const size_t first = all.firstSample[r], count = all.firstSample[r + 1] - first;
    const RayGradients ray = compositeRayBackward(
        a.extinction, a.minTransmittance, all.ofRay(r), all.row(colourGradients, r),
        opacityGradients.empty() ? 0 : opacityGradients[r], depthGradients.empty() ? 0 : depthGradients[r],
        weightGradients.empty() ? View() : View(weightGradients).subspan(first, count));
    for (size_t i = 0; i < count; ++i) {
      double scale = 1;
      if (a.fullGradientDistance > 0) {
        const double nearness = all.distances[first + i] / a.fullGradientDistance;
        scale = std::min(1.0, nearness * nearness);
      }
      x[first + i] = ray.x[i] * scale;
      for (size_t c = 0; c < columns; ++c) colours[columns * (first + i) + c] = ray.colours[columns * i + c] * scale;
    }
  }
  if (a.addToXGradients)
    add(a.xGradients, x);
  else
    store(a.xGradients, x);
  store(a.colourGradients, colours);
}

}  // namespace tessera::reference

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
    case Extinction::logit:
      return 1 / (1 + std::exp(-x));
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
    if (extinction == Extinction::logit) slope = alphas[i] * (1 - alphas[i]);
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
    for (double& value : x) value += a.offset;
    if (usesSteps(a.extinction)) steps = doubles(a.steps, samples);
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

// One ray of OpaqueForward: which samples count, and with which weights.
struct OpaqueRay {
  std::vector<size_t> samples;
  Doubles alphas, before;  // of those samples; transmittance in front of each
  double opacity = 0;
};

OpaqueRay opaqueRay(View alphas, double threshold, double maxOpacity, double minOpacity) {
  OpaqueRay ray;
  double transmittance = 1;
  for (size_t i = 0; i < alphas.size() && 1 - transmittance <= maxOpacity; ++i) {
    if (!(alphas[i] > threshold)) continue;
    ray.samples.push_back(i);
    ray.alphas.push_back(alphas[i]);
    ray.before.push_back(transmittance);
    transmittance *= 1 - alphas[i];
  }
  if (transmittance < 1 && 1 - transmittance >= minOpacity) {
    ray.opacity = 1 - transmittance;
  } else {
    ray.samples.clear();
  }
  return ray;
}

// The samples of all rays of OpaqueForward and OpaqueBackward.
struct OpaqueSamples {
  Indices firstSample;
  Doubles alphas, colours;

  template <class Arguments>
  explicit OpaqueSamples(const Arguments& a) : firstSample(indices(a.firstSample, hostCount(a.rays) + size_t{1})) {
    const size_t samples = firstSample.back();
    for (const double x : doubles(a.x, samples)) alphas.push_back(computeOpacity(Extinction::logit, x + a.offset, 0));
    CHECK(a.colours.columns == 3u);
    colours = doubles(a.colours, samples);
  }
  View alphasOnRay(size_t ray) const {
    return View(alphas).subspan(firstSample[ray], firstSample[ray + 1] - firstSample[ray]);
  }
  View coloursOnRay(size_t ray) const {
    return View(colours).subspan(3 * size_t{firstSample[ray]}, 3 * size_t{firstSample[ray + 1] - firstSample[ray]});
  }
};

}  // namespace

OpaqueColour compositeOpaque(View alphas, View colours, double threshold, double maxOpacity, double minOpacity) {
  const OpaqueRay ray = opaqueRay(alphas, threshold, maxOpacity, minOpacity);
  OpaqueColour result;
  result.opacity = ray.opacity;
  for (size_t k = 0; k < ray.samples.size(); ++k)
    for (int c = 0; c < 3; ++c)
      result.colour[c] += ray.before[k] * ray.alphas[k] / ray.opacity * colours[3 * ray.samples[k] + c];
  return result;
}

OpaqueGradients compositeOpaqueBackward(View alphas, View colours, double threshold, double maxOpacity,
                                        double minOpacity, const Point& gradient) {
  const OpaqueRay ray = opaqueRay(alphas, threshold, maxOpacity, minOpacity);
  const OpaqueColour result = compositeOpaque(alphas, colours, threshold, maxOpacity, minOpacity);
  OpaqueGradients gradients{Doubles(alphas.size()), Doubles(colours.size())};
  double rear = 0;
  for (size_t k = ray.samples.size(); k-- > 0;) {
    const size_t i = ray.samples[k];
    double excess = 0;
    for (int c = 0; c < 3; ++c) {
      excess += gradient[c] * (colours[3 * i + c] - result.colour[c]) / ray.opacity;
      gradients.colours[3 * i + c] = ray.before[k] * ray.alphas[k] / ray.opacity * gradient[c];
    }
    gradients.alphas[i] = ray.before[k] * (excess - rear);
    rear = ray.alphas[k] * excess + (1 - ray.alphas[k]) * rear;
  }
  return gradients;
}

void run(const OpaqueForward& a) {
  const OpaqueSamples all(a);
  Doubles colours, opacities;
  for (size_t ray = 0; ray < hostCount(a.rays); ++ray) {
    const OpaqueColour one =
        compositeOpaque(all.alphasOnRay(ray), all.coloursOnRay(ray), a.threshold, a.maxOpacity, a.minOpacity);
    colours.insert(colours.end(), one.colour.begin(), one.colour.end());
    opacities.push_back(one.opacity);
  }
  store(a.colour, colours);
  store(a.opacity, opacities);
}

void run(const OpaqueBackward& a) {
  const OpaqueSamples all(a);
  const size_t rays = hostCount(a.rays);
  const Doubles rayGradients = doubles(a.rayColourGradients, 3 * rays);
  Doubles x, colours;
  for (size_t ray = 0; ray < rays; ++ray) {
    const View alphas = all.alphasOnRay(ray);
    const OpaqueGradients one =
        compositeOpaqueBackward(alphas, all.coloursOnRay(ray), a.threshold, a.maxOpacity, a.minOpacity,
                                {rayGradients[3 * ray], rayGradients[3 * ray + 1], rayGradients[3 * ray + 2]});
    for (size_t i = 0; i < alphas.size(); ++i) x.push_back(one.alphas[i] * alphas[i] * (1 - alphas[i]));
    colours.insert(colours.end(), one.colours.begin(), one.colours.end());
  }
  add(a.xGradients, x);
  for (size_t i = 0; i < colours.size(); ++i) {
    float& element = hostPointer(a.colourGradients.data)[a.colourGradients.offset(i / 3, i % 3)];
    element = static_cast<float>(element + colours[i]);
  }
}

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

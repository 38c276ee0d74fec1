#include "compute/deferred.h"

#include <algorithm>
#include <cmath>

#include "compute/reference/convert.h"
#include "compute/reference/functions.h"
#include "compute/reference/operations.h"

namespace tessera::reference {
namespace {

constexpr uint32_t kLayers = 3;
constexpr uint32_t kWidths[kLayers + 1] = {DeferredNetwork::kInputs, DeferredNetwork::kHidden, DeferredNetwork::kHidden,
                                           3};

struct Layers {
  Doubles values[kLayers + 1];  // the input, then what leaves each layer
};

Layers throughLayers(View network, View composited, const double direction[3]) {
  CHECK(network.size() == DeferredNetwork::kParameters);
  CHECK(composited.size() == DeferredNetwork::kComposited);
  Layers layers;
  layers.values[0].assign(composited.begin(), composited.end());
  const Doubles encoded = frequencyEncoding(3, 4, direction);
  layers.values[0].insert(layers.values[0].end(), encoded.begin(), encoded.end());
  for (uint32_t l = 0; l < kLayers; ++l) {
    const View weights = network.subspan(DeferredNetwork::kWeights[l]);
    for (uint32_t o = 0; o < kWidths[l + 1]; ++o) {
      double sum = weights[kWidths[l] * kWidths[l + 1] + o];
      for (uint32_t i = 0; i < kWidths[l]; ++i) sum += weights[o * kWidths[l] + i] * layers.values[l][i];
      layers.values[l + 1].push_back(l + 1 < kLayers ? std::max(0.0, sum) : 1 / (1 + std::exp(-sum)));
    }
  }
  return layers;
}

Point pointAt(const Doubles& values, size_t index) {
  return {values[3 * index], values[3 * index + 1], values[3 * index + 2]};
}

}  // namespace

Point deferredForward(View network, View composited, const double direction[3]) {
  return pointAt(throughLayers(network, composited, direction).values[kLayers], 0);
}

DeferredGradients deferredBackward(View network, View composited, const double direction[3], const Point& gradient) {
  const Layers layers = throughLayers(network, composited, direction);
  DeferredGradients gradients{Doubles(network.size()), {}};
  Doubles upstream(gradient.begin(), gradient.end());  // with respect to what leaves layer l
  for (uint32_t l = kLayers; l-- > 0;) {
    const uint32_t first = DeferredNetwork::kWeights[l], inputs = kWidths[l], outputs = kWidths[l + 1];
    Doubles below(inputs);
    for (uint32_t o = 0; o < outputs; ++o) {
      const double y = layers.values[l + 1][o];
      const double slope = l + 1 < kLayers ? (y > 0 ? 1 : 0) : y * (1 - y);
      const double g = upstream[o] * slope;
      gradients.network[first + inputs * outputs + o] += g;
      for (uint32_t i = 0; i < inputs; ++i) {
        gradients.network[first + o * inputs + i] += g * layers.values[l][i];
        below[i] += g * network[first + o * inputs + i];
      }
    }
    upstream = below;
  }
  gradients.composited.assign(upstream.begin(), upstream.begin() + DeferredNetwork::kComposited);
  return gradients;
}

BlendedRay blendRay(bool literal, const RaySegments& segments) {
  BlendedRay ray;
  double transmittance = 1;
  for (size_t k = 0; k < segments.opacities.size(); ++k) {
    const double alpha = segments.opacities[k], gate = literal ? 1 : alpha;
    for (size_t c = 0; c < 3; ++c)
      ray.colour[c] += transmittance * (segments.composited[7 * k + c] + gate * segments.specular[3 * k + c]);
    if (!segments.depths.empty()) ray.depth += transmittance * segments.depths[k];
    transmittance *= 1 - alpha;
  }
  ray.opacity = 1 - transmittance;
  return ray;
}

BlendGradients blendRayBackward(bool literal, const RaySegments& segments, const Point& colourGradient,
                                double opacityGradient) {
  const size_t n = segments.opacities.size();
  BlendGradients gradients{Doubles(7 * n), Doubles(3 * n), Doubles(n)};
  Doubles before;  // transmittance in front of each segment
  double transmittance = 1;
  for (double alpha : segments.opacities) {
    before.push_back(transmittance);
    transmittance *= 1 - alpha;
  }
  double rear = -opacityGradient;  // what one unit of light arriving from behind segment k is worth to the loss
  for (size_t k = n; k-- > 0;) {
    const double alpha = segments.opacities[k], gate = literal ? 1 : alpha;
    double worth = 0, specularWorth = 0;
    for (size_t c = 0; c < 3; ++c) {
      const double g = colourGradient[c];
      worth += g * (segments.composited[7 * k + c] + gate * segments.specular[3 * k + c]);
      specularWorth += g * segments.specular[3 * k + c];
      gradients.composited[7 * k + c] = before[k] * g;
      gradients.specular[3 * k + c] = before[k] * gate * g;
    }
    gradients.opacities[k] = before[k] * ((literal ? 0 : specularWorth) - rear);
    rear = worth + (1 - alpha) * rear;
  }
  return gradients;
}

void run(const DeferredForward& a) {
  const size_t segments = hostCount(a.segments);
  const Indices network = indices(a.networkOfSegment, segments), ray = indices(a.rayOfSegment, segments);
  const Doubles composited = doubles(a.composited, 7 * segments), networks = doubles(a.networks, a.networks.count);
  const Doubles directions = doubles(a.directions, a.directions.count);
  Doubles specular;
  for (size_t s = 0; s < segments; ++s) {
    const size_t first = size_t{network[s]} * DeferredNetwork::kParameters;
    const Point colour = deferredForward(View(networks).subspan(first, DeferredNetwork::kParameters),
                                         View(composited).subspan(7 * s, 7), &directions[3 * ray[s]]);
    specular.insert(specular.end(), colour.begin(), colour.end());
  }
  store(a.specular, specular);
}

void run(const DeferredBackward& a) {
  const size_t segments = hostCount(a.segments);
  const Indices network = indices(a.networkOfSegment, segments), ray = indices(a.rayOfSegment, segments);
  const Doubles composited = doubles(a.composited, 7 * segments), networks = doubles(a.networks, a.networks.count);
  const Doubles directions = doubles(a.directions, a.directions.count);
  const Doubles specularGradients = doubles(a.specularGradients, 3 * segments);
  Doubles compositedGradients, networkGradients(networks.size());
  for (size_t s = 0; s < segments; ++s) {
    const size_t first = size_t{network[s]} * DeferredNetwork::kParameters;
    const DeferredGradients gradients =
        deferredBackward(View(networks).subspan(first, DeferredNetwork::kParameters),
                         View(composited).subspan(7 * s, 7), &directions[3 * ray[s]], pointAt(specularGradients, s));
    compositedGradients.insert(compositedGradients.end(), gradients.composited.begin(), gradients.composited.end());
    for (size_t i = 0; i < gradients.network.size(); ++i) networkGradients[first + i] += gradients.network[i];
  }
  add(a.compositedGradients, compositedGradients);
  add(a.networkGradients, networkGradients);
}

namespace {

// The segments of every ray, owned.
struct AllSegments {
  Indices firstSegment;
  Doubles composited, specular, opacities, depths;

  AllSegments(Indices first, const Slice<const float>& composites, const Slice<const float>& speculars,
              const Slice<const float>& alphas)
      : firstSegment(first),
        composited(doubles(composites, 7 * size_t{first.back()})),
        specular(doubles(speculars, 3 * size_t{first.back()})),
        opacities(doubles(alphas, first.back())) {}
  RaySegments ofRay(size_t ray) const {
    const size_t first = firstSegment[ray], count = firstSegment[ray + 1] - first;
    RaySegments segments;
    segments.composited = View(composited).subspan(7 * first, 7 * count);
    segments.specular = View(specular).subspan(3 * first, 3 * count);
    segments.opacities = View(opacities).subspan(first, count);
    if (!depths.empty()) segments.depths = View(depths).subspan(first, count);
    return segments;
  }
};

}  // namespace

void run(const BlendForward& a) {
  const size_t rays = hostCount(a.rays);
  AllSegments all(indices(a.firstSegment, rays + 1), a.composited, a.specular, a.opacities);
  all.depths = doubles(a.depths, all.firstSegment[rays]);
  Doubles colour, opacity, depth;
  for (size_t r = 0; r < rays; ++r) {
    const BlendedRay ray = blendRay(a.literal, all.ofRay(r));
    colour.insert(colour.end(), ray.colour.begin(), ray.colour.end());
    opacity.push_back(ray.opacity);
    depth.push_back(ray.depth);
  }
  store(a.colour, colour);
  store(a.opacity, opacity);
  store(a.depth, depth);
}

void run(const BlendBackward& a) {
  const size_t rays = hostCount(a.rays);
  const AllSegments all(indices(a.firstSegment, rays + 1), a.composited, a.specular, a.opacities);
  const Doubles colourGradients = doubles(a.rayColourGradients, 3 * rays);
  const Doubles opacityGradients = doubles(a.rayOpacityGradients, rays);
  Doubles composited, specular, opacities;
  for (size_t r = 0; r < rays; ++r) {
    const BlendGradients ray = blendRayBackward(a.literal, all.ofRay(r), pointAt(colourGradients, r),
                                                opacityGradients.empty() ? 0 : opacityGradients[r]);
    composited.insert(composited.end(), ray.composited.begin(), ray.composited.end());
    specular.insert(specular.end(), ray.specular.begin(), ray.specular.end());
    opacities.insert(opacities.end(), ray.opacities.begin(), ray.opacities.end());
  }
  store(a.compositedGradients, composited);
  store(a.specularGradients, specular);
  store(a.opacityGradients, opacities);
}

}  // namespace tessera::reference

#include "compute/deferred.h"

#include <algorithm>
#include <cmath>

#include "compute/reference/convert.h"
#include "compute/reference/functions.h"

namespace tessera::reference {
namespace {

constexpr uint32_t kLayers = 3;
constexpr uint32_t kWidths[kLayers + 1] = {DeferredNetwork::kInputs, DeferredNetwork::kHidden, DeferredNetwork::kHidden,
                                           3};

struct Layers {
  Doubles values[kLayers + 1];  // the input, then the output of each layer
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
  Doubles upstream(gradient.begin(), gradient.end());  // gradient with respect to the output of layer l
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

}  // namespace tessera::reference

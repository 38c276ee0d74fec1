// One invocation per pixel: the network with the largest weight computes the colour from the ray's sums and its
// direction (NGP-RT, eq. 5).
#version 460
#extension GL_GOOGLE_include_directive : require
#include "../../compute/kernel.glsl"
#include "arguments_hash.h"
#include "../../compute/spherical_harmonics.glsl"
#include "../../compute/vectors.glsl"
#include "../../render/view.glsl"

layout(local_size_x = 8, local_size_y = 8) in;
layout(constant_id = 0) const uint kMaxWidth = 23;  // the maximum width of the networks' layers
KERNEL_ARGUMENTS(EndHashArguments)

#include "../../render/dense_network.glsl"

const uint kSums = 7;

uint heaviest(EndHashArguments a, uint first) {
  uint network = a.backgroundContent;
  float maximum = 0;
  for (uint n = 0; n < a.networkCount; ++n) {
    const float weight = a.view.pixels.values[first + 9 + n];
    if (weight <= maximum) continue;
    maximum = weight;
    network = n;
  }
  return network;
}

void main() {
  EndHashArguments a = arguments.values;
  uint pixel;
  if (!pixelIndex(a.view, pixel)) return;
  const uint first = a.view.numbersOfPixel * pixel;
  float transmittance = a.view.pixels.values[first], depth = a.view.pixels.values[first + 1];
  const vec3 d = rayDirection(a.view, pixel);
  vec3 colour = vec3(0);
  const bool hasLearnedBackground = a.hasLearnedBackground != 0 && farthestDistance(a.view, pixel) >= kSceneEnd && d != vec3(0);
  if (a.networkCount > 0 && (hasLearnedBackground || transmittance < 1)) {
    float values[kMaxWidth];
    for (uint i = 0; i < kSums; ++i) values[i] = a.view.pixels.values[first + 2 + i];
    const vec3 diffuse = vec3(values[0], values[1], values[2]);
    for (uint i = 0; i < 16; ++i) values[kSums + i] = harmonic(i, d);
    NetworkArguments network = a.networks.values[heaviest(a, first)];
    runNetwork(LayersPointer(network.layers), network.layerCount, FloatPointer(network.weights), values);
    if (hasLearnedBackground) {
      depth /= max(1 - transmittance, 1e-6);  // normalised as for an opaque pixel
      transmittance = 0;
    }
    colour = (1 - transmittance) / (1 + exp(-(diffuse + vec3(values[0], values[1], values[2]))));
  }
  for (uint c = 0; c < 3; ++c) a.view.colour.values[3 * pixel + c] = colour[c];
  a.view.opacity.values[pixel] = 1 - transmittance;
  a.view.depth.values[pixel] = depth * a.view.directions.values[3 * pixel + 2] * a.view.scale;
}

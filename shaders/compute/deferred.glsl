// City-on-Web's deferred network: 7 composited inputs + 27 of the direction → 16 → 16 → 3.
// Reads: DeferredArguments. Defines: kComposited, kInputs, kHidden, kParameters, kSecond, kThird, kNumbers, Layers,
// computeLayers().
#include "../lib/trigonometry.glsl"
#include "vectors.glsl"

const uint kComposited = 7, kDirection = 27, kInputs = kComposited + kDirection, kHidden = 16;
// Offsets of the parameters of the second and third layers.
const uint kSecond = kInputs * kHidden + kHidden, kThird = kSecond + kHidden * kHidden + kHidden;
const uint kParameters = kThird + kHidden * 3 + 3;
const uint kNumbers = TESSERA_DEFERRED_NUMBERS;

struct Layers {
  float inputs[kInputs];
  float first[kHidden];
  float second[kHidden];
  vec3 colour;
};

Layers computeLayers(DeferredArguments a, uint segment) {
  Layers layers;
  [[unroll]] for (uint i = 0; i < kComposited; ++i) {
    layers.inputs[i] = a.composited.values[kComposited * segment + i];
  }
  const vec3 direction = pointAt(a.directions, a.rayOfSegment.values[segment]);
  [[unroll]] for (uint axis = 0; axis < 3; ++axis) {
    layers.inputs[kComposited + axis] = direction[axis];
    [[unroll]] for (uint k = 0; k < 4; ++k) {
      const vec2 wave = sineAndCosine(direction[axis] * float(1 << k));
      layers.inputs[kComposited + 3 + 3 * k + axis] = wave.x;
      layers.inputs[kComposited + 15 + 3 * k + axis] = wave.y;
    }
  }
  FloatPointer weights = a.networks;
  const uint network = a.networkOfSegment.values[segment] * kParameters;
  for (uint o = 0; o < kHidden; ++o) {
    float sum = weights.values[network + kInputs * kHidden + o];
    for (uint i = 0; i < kInputs; ++i) sum += weights.values[network + o * kInputs + i] * layers.inputs[i];
    layers.first[o] = max(sum, 0);
  }
  for (uint o = 0; o < kHidden; ++o) {
    float sum = weights.values[network + kSecond + kHidden * kHidden + o];
    for (uint i = 0; i < kHidden; ++i) sum += weights.values[network + kSecond + o * kHidden + i] * layers.first[i];
    layers.second[o] = max(sum, 0);
  }
  for (uint o = 0; o < 3; ++o) {
    float sum = weights.values[network + kThird + kHidden * 3 + o];
    for (uint i = 0; i < kHidden; ++i) sum += weights.values[network + kThird + o * kHidden + i] * layers.second[i];
    layers.colour[o] = 1 / (1 + exp(-sum));
  }
  return layers;
}

// DeferredBackward: one invocation per segment, which computes the gradients of its inputs and the factors that
// deferred_weight_gradients.comp needs.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "kernel.glsl"
#include "arguments_deferred.h"
#include "deferred.glsl"

layout(local_size_x = 64) in;
KERNEL_ARGUMENTS(DeferredArguments)

void main() {
  DeferredArguments a = arguments.values;
  FOR_EACH_ROW(segment, a.segments) {
    const Layers layers = computeLayers(a, segment);
    FloatPointer weights = a.networks;
    const uint network = a.networkOfSegment.values[segment] * kParameters;
    const vec3 third = pointAt(a.specular, segment) * layers.colour * (1 - layers.colour);
    float second[kHidden], first[kHidden];
    for (uint i = 0; i < kHidden; ++i) {
      float sum = 0;
      for (uint o = 0; o < 3; ++o) sum += third[o] * weights.values[network + kThird + o * kHidden + i];
      second[i] = layers.second[i] > 0 ? sum : 0;
    }
    for (uint i = 0; i < kHidden; ++i) {
      float sum = 0;
      for (uint o = 0; o < kHidden; ++o) sum += second[o] * weights.values[network + kSecond + o * kHidden + i];
      first[i] = layers.first[i] > 0 ? sum : 0;
    }
    for (uint i = 0; i < kComposited; ++i) {
      float sum = 0;
      for (uint o = 0; o < kHidden; ++o) sum += first[o] * weights.values[network + o * kInputs + i];
      a.compositedGradients.values[kComposited * segment + i] += sum;
    }
    const uint at = segment * kNumbers;
    for (uint i = 0; i < kInputs; ++i) a.layers.values[at + i] = layers.inputs[i];
    for (uint i = 0; i < kHidden; ++i) {
      a.layers.values[at + kInputs + i] = layers.first[i];
      a.layers.values[at + kInputs + kHidden + i] = layers.second[i];
      a.layers.values[at + kInputs + 2 * kHidden + i] = first[i];
      a.layers.values[at + kInputs + 3 * kHidden + i] = second[i];
    }
    for (uint o = 0; o < 3; ++o) a.layers.values[at + kInputs + 4 * kHidden + o] = third[o];
  }
}

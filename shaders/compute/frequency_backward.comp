// FrequencyBackward: one invocation per input number.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "kernel.glsl"
#include "arguments_encodings.h"
#include "../lib/trigonometry.glsl"

layout(local_size_x = 256) in;
KERNEL_ARGUMENTS(FrequencyArguments)

float gradientAt(FrequencyArguments a, uint row, uint column) {
  return a.encoded.data.values[elementIndex(a.encoded, row, column)];
}

void main() {
  FrequencyArguments a = arguments.values;
  FOR_EACH(i, rowRangeEnd(a.samples) * a.dimensions) {
    const uint row = i / a.dimensions, d = i % a.dimensions;
    float sum = gradientAt(a, row, d);
    for (uint k = 0; k < a.frequencies; ++k) {
      const uint ofSine = a.dimensions * (1 + k) + d, ofCosine = ofSine + a.dimensions * a.frequencies;
      const float frequency = float(1u << k), angle = a.inputs.values[i] * frequency;
      const vec2 slopes = vec2(1, -1) * sineAndCosine(angle).yx;
      sum += frequency * (gradientAt(a, row, ofSine) * slopes.x + gradientAt(a, row, ofCosine) * slopes.y);
    }
    a.inputGradients.values[i] = sum;
  }
}

// One invocation a number of the input.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "kernel.glsl"
#include "arguments_encodings.h"

layout(local_size_x = 256) in;
KERNEL_ARGUMENTS(FrequencyArguments)

float gradientAt(FrequencyArguments a, uint row, uint column) {
  return a.encoded.data.values[elementOf(a.encoded, row, column)];
}

void main() {
  FrequencyArguments a = arguments.values;
  FOR_EACH(i, endOf(a.samples) * a.dimensions) {
    const uint row = i / a.dimensions, d = i % a.dimensions;
    float sum = gradientAt(a, row, d);
    for (uint k = 0; k < a.frequencies; ++k) {
      const uint sine = a.dimensions * (1 + k) + d, cosine = sine + a.dimensions * a.frequencies;
      const float frequency = float(1u << k), angle = a.inputs.values[i] * frequency;
      sum += frequency * (gradientAt(a, row, sine) * cos(angle) - gradientAt(a, row, cosine) * sin(angle));
    }
    a.inputGradients.values[i] = sum;
  }
}

// FrequencyForward: one invocation per element. The columns are x, then all sines, then all cosines.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "kernel.glsl"
#include "arguments_encodings.h"
#include "../lib/trigonometry.glsl"

layout(local_size_x = 256) in;
KERNEL_ARGUMENTS(FrequencyArguments)

void main() {
  FrequencyArguments a = arguments.values;
  const uint waves = a.dimensions * a.frequencies, columns = a.dimensions + 2 * waves;
  FOR_EACH(i, rowRangeEnd(a.samples) * columns) {
    const uint row = i / columns, column = i % columns;
    float value = a.inputs.values[row * a.dimensions + column % a.dimensions];
    if (column >= a.dimensions) {
      const uint wave = (column - a.dimensions) % waves;
      value *= float(1u << wave / a.dimensions);
      value = column < a.dimensions + waves ? sine(value) : cosine(value);
    }
    a.encoded.data.values[elementIndex(a.encoded, row, column)] = value;
  }
}

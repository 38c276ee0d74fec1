// MixRowsBackward: one invocation per row that a sample mixes.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "float_sum.glsl"
#include "kernel.glsl"
#include "arguments_patches.h"

layout(local_size_x = 128) in;
KERNEL_ARGUMENTS(MixRowsArguments)

void main() {
  MixRowsArguments a = arguments.values;
  SumPointer sums = SumPointer(a.source.data);
  const uint inputRows = rowRangeEnd(a.inputRows);
  FOR_EACH(k, rowRangeEnd(a.samples) * a.perSample) {
    const uint row = a.rows.values[k], index = k / a.perSample;
    const float weight = a.weights.values[k];
    if (row >= inputRows || weight == 0) continue;
    for (uint column = 0; column < a.mixed.columns; ++column) {
      const float gradient = a.mixed.data.values[elementIndex(a.mixed, index, column)];
      if (gradient != 0) addTo(sums, elementIndex(a.source, row, column), weight * gradient);
    }
  }
}

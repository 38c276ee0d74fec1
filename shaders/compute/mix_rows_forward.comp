// MixRowsForward: one invocation per number.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "kernel.glsl"
#include "arguments_patches.h"

layout(local_size_x = 256) in;
KERNEL_ARGUMENTS(MixRowsArguments)

void main() {
  MixRowsArguments a = arguments.values;
  const uint columns = a.mixed.columns, inputRows = rowRangeEnd(a.inputRows);
  FOR_EACH(i, rowRangeEnd(a.samples) * columns) {
    const uint index = i / columns, column = i % columns, offset = columnOffset(a.source, column);
    float sum = 0;
    for (uint k = index * a.perSample; k < (index + 1) * a.perSample; ++k) {
      const uint row = a.rows.values[k];
      const float weight = a.weights.values[k];
      if (row < inputRows && weight != 0) sum += weight * a.source.data.values[offset + row * a.source.rowStride];
    }
    a.mixed.data.values[elementIndex(a.mixed, index, column)] = sum;
  }
}

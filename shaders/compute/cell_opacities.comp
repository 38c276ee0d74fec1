// First kernel of MergeOctahedra: the mean opacity of each listed cell. One invocation per cell.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "kernel.glsl"
#include "arguments_octahedra.h"
#include "composite.glsl"

layout(local_size_x = 64) in;
KERNEL_ARGUMENTS(MergeOctahedraArguments)

void main() {
  MergeOctahedraArguments a = arguments.values;
  FOR_EACH(i, a.listed) {
    float sum = 0;
    for (uint p = 0; p < a.points; ++p) {
      sum += computeOpacity(kLogit, a.x.data.values[elementIndex(a.x, p * a.listed + i, 0)] + a.offset, 0);
    }
    a.opacities.values[a.cells.values[i]] = sum / a.points;
  }
}

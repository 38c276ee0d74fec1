// VirtualGridBackward: one invocation per sample. Quantisation has a straight-through gradient.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "float_sum.glsl"
#include "kernel.glsl"
#include "arguments_virtual_grid.h"
#include "vectors.glsl"
#include "virtual_grid.glsl"

layout(local_size_x = 64) in;
layout(constant_id = 0) const uint kCorners = 20;
KERNEL_ARGUMENTS(VirtualGridLookupArguments)

const uint kAttributes = 8;
const float kCulled = -1e30;

void main() {
  VirtualGridLookupArguments a = arguments.values;
  const uint rows = rowRangeEnd(a.texels);
  FOR_EACH_ROW(index, a.samples) {
    float gradient[kAttributes];  // of the sums
    const float logDensity = a.logDensities.values[index];
    const bool passes = logDensity > kCulled / 2 && logDensity < 15;
    gradient[0] = passes ? 2 * a.grid.densityRange * a.logDensityGradients.values[index] : 0;
    bool any = gradient[0] != 0;
    [[unroll]] for (uint f = 1; f < kAttributes; ++f) {
      const uint at = (kAttributes - 1) * index + f - 1;
      const float c = a.colours.values[at];
      gradient[f] = 2 * a.grid.featureRange * a.colourGradients.values[at] * c * (1 - c);
      any = any || gradient[f] != 0;
    }
    if (!any) continue;
    const Places places = findPlaces(a.grid, pointAt(a.positions, index));
    const uint block = a.blockOfSample.values[index];
    [[unroll]] for (uint k = 0; k < kCorners; ++k) {
      const Corner corner = cornerAt(a.grid, places, k);
      const uint row = texelRow(a.grid, a.marks, a.ranks, block, index, k, corner.texel);
      if (row >= rows || corner.weight == 0) continue;
      [[unroll]] for (uint f = 0; f < kAttributes; ++f) {
        addTo(a.attributeGradients, kAttributes * row + f, corner.weight * gradient[f]);
      }
    }
  }
}

// VirtualGridForward: one invocation per sample.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "kernel.glsl"
#include "arguments_virtual_grid.h"
#include "composite.glsl"
#include "vectors.glsl"
#include "virtual_grid.glsl"

layout(local_size_x = 64) in;
layout(constant_id = 0) const uint kCorners = 20;
KERNEL_ARGUMENTS(VirtualGridLookupArguments)

const uint kAttributes = 8;
const float kCulled = -1e30;

void main() {
  VirtualGridLookupArguments a = arguments.values;
  FOR_EACH_ROW(index, a.samples) {
    const Places places = findPlaces(a.grid, pointAt(a.positions, index));
    const uint block = a.blockOfSample.values[index];
    float sums[kAttributes];
    [[unroll]] for (uint f = 0; f < kAttributes; ++f) sums[f] = 0;
    [[unroll]] for (uint k = 0; k < kCorners; ++k) {
      const Corner corner = cornerAt(a.grid, places, k);
      const uint row = texelRow(a.grid, a.marks, a.ranks, block, index, k, corner.texel);
      if (row >= a.texels.capacity) continue;  // a missing texel counts as ½, which adds 0
      const vec4 quads[2] = {Vec4Pointer(a.attributes).values[2 * row], Vec4Pointer(a.attributes).values[2 * row + 1]};
      [[unroll]] for (uint f = 0; f < kAttributes; ++f) {
        const float value = quads[f / 4][f % 4];
        sums[f] += corner.weight * (2 * (a.grid.quantise != 0 ? quantised(value) : value) - 1);
      }
    }
    float logDensity = min(a.grid.densityRange * sums[0] - 1, 15);
    if (a.minAlpha > 0 && computeOpacity(kLogDensity, logDensity, a.runtimeSteps.values[index]) < a.minAlpha) {
      logDensity = kCulled;
    }
    a.logDensities.values[index] = logDensity;
    [[unroll]] for (uint f = 1; f < kAttributes; ++f) {
      a.colours.values[(kAttributes - 1) * index + f - 1] = 1 / (1 + exp(-a.grid.featureRange * sums[f]));
    }
  }
}

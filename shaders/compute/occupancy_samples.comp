// OccupancySamples: one invocation per ray. Non-negative floats have the same order as their bits.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "kernel.glsl"
#include "arguments_rays.h"
#include "composite.glsl"
#include "vectors.glsl"

layout(local_size_x = 64) in;
KERNEL_ARGUMENTS(OccupancySamplesArguments)

void main() {
  OccupancySamplesArguments a = arguments.values;
  FOR_EACH_ROW(ray, a.rays) {
    float transmittance = 1;
    const uint end = a.firstSample.values[ray + 1];
    for (uint i = a.firstSample.values[ray]; i < end && transmittance > a.minTransmittance; ++i) {
      const float alpha = computeOpacity(kLogit, a.x.data.values[elementIndex(a.x, i, 0)] + a.offset, 0);
      const uvec3 place = min(uvec3(pointAt(a.positions, i) * float(a.resolution)), uvec3(a.resolution - 1));
      const uint cell = place.x + a.resolution * (place.y + a.resolution * place.z);
      if (!(a.grid.values[cell] < 0) && alpha >= 0) atomicMax(a.gridBits.values[cell], floatBitsToUint(alpha));
      transmittance *= 1 - alpha;
    }
  }
}

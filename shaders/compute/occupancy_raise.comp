// Second kernel of OccupancyUpdate: raises the chosen cells to the sampled values. Non-negative floats have the same
// order as their bits.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "kernel.glsl"
#include "arguments_rays.h"

layout(local_size_x = 256) in;
KERNEL_ARGUMENTS(OccupancyUpdateArguments)

// Returns the marching step at a cell's centre.
float stepAt(OccupancyUpdateArguments a, uint cell) {
  const uint r = a.resolution;
  const vec3 u = (vec3(cell % r, cell / r % r, cell / (r * r)) + 0.5) / float(r);
  const vec3 y = abs(a.contracted != 0 ? 4 * u - 2 : 2 * u - 1);
  const float largest = max(y.x, max(y.y, y.z));
  return clamp(a.cone * (largest > 1 ? 1 / (2 - largest) : largest), a.minStep, a.maxStep);
}

void main() {
  OccupancyUpdateArguments a = arguments.values;
  FOR_EACH(p, a.points) {
    const uint cell = a.cells.values[p];
    if (a.grid.values[cell] < 0) continue;
    const float seen = exp(min(a.logDensity.data.values[elementIndex(a.logDensity, p, 0)], 15)) * stepAt(a, cell);
    atomicMax(a.gridBits.values[cell], floatBitsToUint(seen));
  }
}

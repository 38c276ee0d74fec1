// Second kernel of MergeOctahedra: one invocation per cell of the coarser grid.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "kernel.glsl"
#include "arguments_octahedra.h"
#include "vectors.glsl"

layout(local_size_x = 64) in;
KERNEL_ARGUMENTS(MergeOctahedraArguments)

const float kTransparent = 1e-3;

void main() {
  MergeOctahedraArguments a = arguments.values;
  const uint n = a.resolution, coarse = n / 2;
  FOR_EACH(cell, coarse * coarse * coarse) {
    const uvec3 place = uvec3(cell % coarse, cell / coarse % coarse, cell / (coarse * coarse));
    float largest = kTransparent;
    vec3 displacement = vec3(0);
    for (uint child = 0; child < 8; ++child) {
      const uvec3 side = uvec3(child & 1, child >> 1 & 1, child >> 2), at = 2 * place + side;
      const uint fine = at.x + n * (at.y + n * at.z);
      if (!(a.opacities.values[fine] > largest)) continue;
      largest = a.opacities.values[fine];
      displacement = 0.5 * (vec3(side) - 0.5 + pointAt(a.displacements, fine));
    }
    storePoint(a.merged, cell, displacement);
  }
}

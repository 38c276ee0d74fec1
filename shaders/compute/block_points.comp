// BlockPoints: one invocation per random point; src/compute/blocks.h defines the distribution.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "kernel.glsl"
#include "arguments_blocks.h"
#include "../lib/trigonometry.glsl"
#include "real.glsl"
#include "block_space.glsl"
#include "random.glsl"
#include "vectors.glsl"

layout(local_size_x = 128) in;
KERNEL_ARGUMENTS(BlockPointsArguments)

void main() {
  BlockPointsArguments a = arguments.values;
  FOR_EACH(p, a.points) {
    const uint index = 8 * p;
    const uint block = a.blocks.values[randomBelow(a.key, index, a.blockCount)];
    const Placement placement = computePlacement(a.space, block);
    const real all = placement.halfDomain;
    realVec3 y;
    for (uint axis = 0; axis < 3; ++axis) {
      const real u = randomUniform(a.key, index + 1 + axis);
      y[axis] = axis == 2 && !placement.contracted ? a.space.bottom + u * (real(a.space.top) - a.space.bottom)
                                                   : all * (2 * u - 1);
    }
    storePoint(a.positions, p, vec3((y + all) / (2 * all)));
    const float z = 2 * randomUniform(a.key, index + 4) - 1;
    const float angle = 6.283185307179586 * randomUniform(a.key, index + 5), across = sqrt(1 - z * z);
    const real maximum = all - 1 / kFarthest;
    y = clamp(y, -maximum, maximum);
    const realVec3 direction = realVec3(across * sineAndCosine(angle).yx, z);
    const real texel = runtimeStepAt(placement, a.texels, placement.contracted ? uncontracted(y) : y, direction);
    a.runtimeSteps.values[p] = float(texel);
    a.blockOfSample.values[p] = IS_SET(a.slotOfBlock) ? a.slotOfBlock.values[block] : block;
  }
}

// OccupancyPoints: one invocation per point; src/compute/occupancy.h defines how it is chosen.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "kernel.glsl"
#include "arguments_rays.h"
#include "random.glsl"
#include "vectors.glsl"

layout(local_size_x = 128) in;
KERNEL_ARGUMENTS(OccupancyPointsArguments)

uint candidateCell(OccupancyPointsArguments a, uint candidate) {
  return IS_SET(a.candidates) ? a.candidates.values[candidate] : candidate;
}

void main() {
  OccupancyPointsArguments a = arguments.values;
  FOR_EACH(p, a.points) {
    const uint point = a.first + p, index = 16 * point;
    const bool inOrder = point < a.uniform_ && a.uniform_ == a.candidateCount;
    uint cell = candidateCell(a, inOrder ? point : randomBelow(a.key, index, a.candidateCount));
    if (point >= a.uniform_) {
      for (uint attempt = 1; attempt < 10 && (a.occupancy.values[cell / 32] >> cell % 32 & 1) == 0; ++attempt) {
        cell = candidateCell(a, randomBelow(a.key, index + attempt, a.candidateCount));
      }
    }
    a.cells.values[p] = cell;
    const uint r = a.resolution;
    const vec3 corner = vec3(cell % r, cell / r % r, cell / (r * r));
    const vec3 jitter =
        vec3(randomUniform(a.key, index + 10), randomUniform(a.key, index + 11), randomUniform(a.key, index + 12));
    storePoint(a.positions, p, (corner + jitter) / float(r));
  }
}

// SphericalHarmonicsBackward: one invocation per sample.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "kernel.glsl"
#include "arguments_encodings.h"
#include "spherical_harmonics.glsl"
#include "vectors.glsl"

layout(local_size_x = 128) in;
KERNEL_ARGUMENTS(SphericalHarmonicsArguments)

void main() {
  SphericalHarmonicsArguments a = arguments.values;
  FOR_EACH_ROW(row, a.samples) {
    const vec3 direction = pointAt(a.directions, IS_SET(a.rayOfSample) ? a.rayOfSample.values[row] : row);
    vec3 sum = vec3(0);
    for (uint column = 0; column < a.degree * a.degree; ++column) {
      sum += a.encoded.data.values[elementIndex(a.encoded, row, column)] * harmonicSlope(column, direction);
    }
    storePoint(a.directionGradients, row, sum);
  }
}

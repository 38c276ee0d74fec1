// SphericalHarmonicsForward: one invocation per element.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "kernel.glsl"
#include "arguments_encodings.h"
#include "spherical_harmonics.glsl"
#include "vectors.glsl"

layout(local_size_x = 256) in;
KERNEL_ARGUMENTS(SphericalHarmonicsArguments)

void main() {
  SphericalHarmonicsArguments a = arguments.values;
  const uint columns = a.degree * a.degree;
  FOR_EACH(i, rowRangeEnd(a.samples) * columns) {
    const uint row = i / columns, column = i % columns;
    const vec3 direction = pointAt(a.directions, IS_SET(a.rayOfSample) ? a.rayOfSample.values[row] : row);
    a.encoded.data.values[elementIndex(a.encoded, row, column)] = harmonic(column, direction);
  }
}

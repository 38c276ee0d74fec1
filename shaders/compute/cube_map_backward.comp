// CubeMapBackward: one invocation per ray, which adds to four texels.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "float_sum.glsl"
#include "kernel.glsl"
#include "arguments_cube_map.h"
#include "cube_map.glsl"
#include "vectors.glsl"

layout(local_size_x = 128) in;
KERNEL_ARGUMENTS(CubeMapArguments)

void main() {
  CubeMapArguments a = arguments.values;
  FOR_EACH_ROW(ray, a.rays) {
    vec3 gradient = pointAt(a.colours, ray);
    if (IS_SET(a.opacity)) gradient *= 1 - a.opacity.values[ray];
    CubeMapPlace place;
    if (gradient == vec3(0) || !findCubeMapPlace(a.resolution, pointAt(a.directions, ray), place)) continue;
    for (uint corner = 0; corner < 4; ++corner) {
      const uint texel = cubeMapTexel(place, a.resolution, corner);
      const vec3 share = cubeMapWeight(place, corner) * gradient;
      for (uint channel = 0; channel < 3; ++channel) addTo(a.texelGradients, 3 * texel + channel, share[channel]);
    }
  }
}

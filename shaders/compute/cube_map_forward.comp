// CubeMapForward: one invocation per ray.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "kernel.glsl"
#include "arguments_cube_map.h"
#include "cube_map.glsl"
#include "vectors.glsl"

layout(local_size_x = 128) in;
KERNEL_ARGUMENTS(CubeMapArguments)

void main() {
  CubeMapArguments a = arguments.values;
  FOR_EACH_ROW(ray, a.rays) {
    vec3 colour = vec3(0);
    CubeMapPlace place;
    if (findCubeMapPlace(a.resolution, pointAt(a.directions, ray), place)) {
      for (uint corner = 0; corner < 4; ++corner) {
        colour += cubeMapWeight(place, corner) * pointAt(a.texels, cubeMapTexel(place, a.resolution, corner));
      }
    }
    storePoint(a.colours, ray, colour);
  }
}

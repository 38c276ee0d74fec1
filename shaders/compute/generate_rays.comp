// GenerateRays: one invocation per ray.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "kernel.glsl"
#include "arguments_rays.h"
#include "lens.glsl"
#include "vectors.glsl"

layout(local_size_x = 64) in;
KERNEL_ARGUMENTS(GenerateRaysArguments)

void main() {
  GenerateRaysArguments a = arguments.values;
  FOR_EACH_ROW(ray, a.rays) {
    const RayCamera camera = cameraAt(a.cameras, a.cameraOfRay.values[ray]);
    const vec2 pixel = vec2(a.pixels.values[2 * ray], a.pixels.values[2 * ray + 1]);
    vec3 direction;
    if (lensUnproject(camera.lens, camera.parameters, pixel, direction)) {
      direction = normalize(camera.sceneFromCamera * direction);
    } else {
      direction = vec3(0);
    }
    storePoint(a.origins, ray, camera.centre);
    storePoint(a.directions, ray, direction);
  }
}

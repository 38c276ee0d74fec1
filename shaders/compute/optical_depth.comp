// OpticalDepth: one invocation per ray.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "kernel.glsl"
#include "arguments_rays.h"

layout(local_size_x = 64) in;
KERNEL_ARGUMENTS(OpticalDepthArguments)

void main() {
  OpticalDepthArguments a = arguments.values;
  FOR_EACH_ROW(ray, a.rays) {
    float sum = a.opticalDepth.values[ray];
    for (uint i = a.firstSample.values[ray]; i < a.firstSample.values[ray + 1]; ++i) {
      sum += exp(a.logDensity.data.values[elementIndex(a.logDensity, i, 0)]) * a.steps.values[i];
    }
    a.opticalDepth.values[ray] = sum;
  }
}

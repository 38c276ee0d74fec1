// DeferredForward: one invocation per segment.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "kernel.glsl"
#include "arguments_deferred.h"
#include "deferred.glsl"

layout(local_size_x = 64) in;
KERNEL_ARGUMENTS(DeferredArguments)

void main() {
  DeferredArguments a = arguments.values;
  FOR_EACH_ROW(segment, a.segments) storePoint(a.specular, segment, computeLayers(a, segment).colour);
}

// EnterScene: one invocation per fence post.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "kernel.glsl"
#include "arguments_blocks.h"
#include "real.glsl"
#include "block_space.glsl"
#include "vectors.glsl"

layout(local_size_x = 128) in;
KERNEL_ARGUMENTS(EnterSceneArguments)

Range computeRayRange(EnterSceneArguments a, uint ray) {
  const realVec3 o = realVec3(pointAt(a.origins, ray)), d = realVec3(pointAt(a.directions, ray));
  real near = a.space.near;
  if (IS_SET(a.nearOfRay)) near = max(near, real(a.nearOfRay.values[ray]));
  if (d == realVec3(0)) return Range(near, near);
  const Range range = rangeInBox(a.space, o, d, near);
  if (!isEmpty(range)) return range;
  return Range(near, a.space.backgroundBlock == kBackgroundBlockNone ? near : near + 1 + length(o));
}

void main() {
  EnterSceneArguments a = arguments.values;
  const uint posts = a.intervals + 1;
  FOR_EACH(i, rowRangeEnd(a.rays) * posts) {
    const uint ray = i / posts, post = i % posts;
    const float jitter = IS_SET(a.jitter) ? a.jitter.values[ray] : 0.5;
    const bool atEnd = post == 0 || post == a.intervals;
    a.fences.values[i] = atEnd ? float(post / a.intervals) : (float(post) + jitter - 0.5) / float(a.intervals);
    if (post > 0) continue;
    const Range range = computeRayRange(a, ray);
    a.range.values[2 * ray] = float(range.near);
    a.range.values[2 * ray + 1] = float(range.far);
  }
}

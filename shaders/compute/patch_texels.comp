// PatchTexels: one invocation per hit.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "kernel.glsl"
#include "arguments_patches.h"

layout(local_size_x = 128) in;
KERNEL_ARGUMENTS(PatchTexelsArguments)

const uint kNoPatch = 0xffffffffu;

// Returns a permutation of the numbers 0 to 2; see patchPermutation in patches.h.
uvec3 patchPermutation(uint number) {
  const uint first = number / 2, lower = first == 0 ? 1 : 0, upper = first == 2 ? 1 : 2;
  return number % 2 == 0 ? uvec3(first, lower, upper) : uvec3(first, upper, lower);
}

// Returns the shares of the corners of the triangle in the position of hit s.
vec3 cornerShares(PatchTexelsArguments a, uint s, uint place, bool isSecond) {
  const float second = a.barycentrics.values[2 * s], third = a.barycentrics.values[2 * s + 1];
  const vec3 ofVertices = vec3(1 - second - third, second, third);
  const uvec3 corners = patchPermutation(place % 8);
  vec3 shares = vec3(0);
  for (uint corner = 0; corner < 3; ++corner) {
    shares[corner] = dot(ofVertices, vec3(equal(corners, uvec3(corner))));
  }
  if (!IS_SET(a.cornerFactors)) return shares;
  for (uint corner = 0; corner < 3; ++corner) {
    shares[corner] *= a.cornerFactors.values[4 * (place / 16) + (isSecond ? 3 - corner : corner)];
  }
  return shares / (shares.x + shares.y + shares.z);
}

void main() {
  PatchTexelsArguments a = arguments.values;
  const uint edge = a.patchEdge;
  const float last = float(edge - 1);
  FOR_EACH_ROW(s, a.samples) {
    uint texel[4] = {0, 0, 0, 0};
    float weight[4] = {0, 0, 0, 0};
    const uint place = a.patchOfFace.values[a.faces.values[s]];
    if (place != kNoPatch) {
      const bool isSecond = (place & 8) != 0;
      const vec3 shares = cornerShares(a, s, place, isSecond);
      const vec2 along = last * (isSecond ? 1 - shares.yz : shares.yz);
      const vec2 at = min(max(along, vec2(0)), vec2(last));
      const uvec2 lower = min(uvec2(at), uvec2(edge - 2));
      const vec2 between = at - vec2(lower);
      texel[0] = (place / 16 * edge + lower.y) * edge + lower.x;
      texel[1] = texel[0] + 1;
      texel[2] = texel[0] + edge;
      texel[3] = texel[2] + 1;
      weight[0] = (1 - between.x) * (1 - between.y);
      weight[1] = between.x * (1 - between.y);
      weight[2] = (1 - between.x) * between.y;
      weight[3] = between.x * between.y;
    }
    for (uint k = 0; k < 4; ++k) {
      a.texels.values[4 * s + k] = texel[k];
      a.weights.values[4 * s + k] = weight[k];
    }
  }
}

// Shades models as the browser does (web/src/app/models/model-light.ts): a sun, and a sky above a ground that models
// reflect. There are no shadows. Writes the colour as in photos (sRGB), and the z-depth.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "../compute/kernel.glsl"
#include "arguments_world.h"

KERNEL_ARGUMENTS(DrawModelArguments)

layout(location = 0) in vec3 fromEye;
layout(location = 1) in vec3 normal;
layout(location = 2) in vec2 place;
layout(location = 3) in vec4 colour;
layout(location = 4) in float depth;
layout(location = 5) flat in uint material;
layout(location = 0) out vec4 drawnColour;
layout(location = 1) out float drawnDepth;

const float kPi = 3.14159265;
const vec3 kSun = vec3(1, 0.904661, 0.775822) * 1.35;     // linear, as all colours here
const vec3 kTowardsSun = vec3(0.4267, -0.2987, 0.8534);   // of length 1
const vec3 kSky = vec3(0.737910, 0.814847, 0.913099), kGround = vec3(0.266356, 0.242281, 0.201556);
const float kHemisphere = 0.4, kReflected = 0.6;  // intensities

vec3 linearFromSrgb(vec3 x) {
  return mix(pow((x + 0.055) / 1.055, vec3(2.4)), x / 12.92, lessThanEqual(x, vec3(0.04045)));
}

vec3 srgbFromLinear(vec3 x) {
  return mix(1.055 * pow(x, vec3(1 / 2.4)) - 0.055, 12.92 * x, lessThanEqual(x, vec3(0.0031308)));
}

vec4 texelAt(ModelTextureArguments a, uint level, ivec2 at) {
  uint first = 0;
  for (uint l = 0; l < level; ++l) first += max(a.width >> l, 1) * max(a.height >> l, 1);
  const ivec2 size = ivec2(max(a.width >> level, 1), max(a.height >> level, 1));
  const ivec2 repeated = ((at % size) + size) % size;
  const vec4 texel = unpackUnorm4x8(a.texels.values[first + uint(repeated.y * size.x + repeated.x)]);
  return vec4(linearFromSrgb(texel.rgb), texel.a);
}

vec4 mixLevel(ModelTextureArguments a, uint level, vec2 where) {
  const vec2 size = vec2(max(a.width >> level, 1), max(a.height >> level, 1));
  const vec2 at = fract(where) * size - 0.5, low = floor(at), share = at - low;
  const ivec2 first = ivec2(low);
  return mix(mix(texelAt(a, level, first), texelAt(a, level, first + ivec2(1, 0)), share.x),
             mix(texelAt(a, level, first + ivec2(0, 1)), texelAt(a, level, first + ivec2(1, 1)), share.x), share.y);
}

vec4 textureColour(ModelTextureArguments a, vec2 where, vec2 alongX, vec2 alongY) {
  const vec2 size = vec2(a.width, a.height), x = size * alongX, y = size * alongY;
  const float level = clamp(0.5 * log2(max(max(dot(x, x), dot(y, y)), 1e-12)), 0, a.levels - 1);
  const uint finer = uint(level);
  const vec4 fine = mixLevel(a, finer, where);
  return level == finer ? fine : mix(fine, mixLevel(a, finer + 1, where), level - finer);
}

void main() {
  DrawModelArguments a = arguments.values;
  const vec2 alongX = dFdx(place), alongY = dFdy(place);
  ModelMaterialArguments m = a.materials.values[material];
  if (!gl_FrontFacing && m.isDoubleSided == 0) discard;
  vec4 base = vec4(m.baseColour[0], m.baseColour[1], m.baseColour[2], m.opacity) * colour;
  if (m.texture != 0) base *= textureColour(a.textures.values[m.texture - 1], place, alongX, alongY);
  if (base.a < m.cutoff) discard;
  vec3 seen = base.rgb;
  if (m.isLit != 0) {
    const vec3 n = normalize(gl_FrontFacing ? normal : -normal), towardsEye = -normalize(fromEye);
    const vec3 around = mix(kGround, kSky, 0.5 + 0.5 * n.z);
    const vec3 light = kSun / kPi * max(dot(n, kTowardsSun), 0) + (kHemisphere / kPi + kReflected) * around;
    const float up = reflect(-towardsEye, n).z, blur = mix(0.15, 1, m.roughness);
    const vec3 mirrored = kReflected * mix(kGround, kSky, smoothstep(-blur, blur, up));
    seen = (1 - m.metalness) * base.rgb * light + mix(vec3(0.04), base.rgb, m.metalness) * mirrored;
  }
  seen += vec3(m.emission[0], m.emission[1], m.emission[2]);
  drawnColour = vec4(srgbFromLinear(clamp(seen, 0, 1)), 1);
  drawnDepth = depth;
}

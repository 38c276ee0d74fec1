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

// `first`: the level's first texel. `at`: at most one texel beyond its edges; the image repeats.
vec4 texelAt(ModelTextureArguments a, uint first, ivec2 size, ivec2 at, bool isSrgb) {
  const ivec2 repeated = clamp(at - size * ivec2(greaterThanEqual(at, size)) + size * ivec2(lessThan(at, ivec2(0))),
                               ivec2(0), size - 1);
  const vec4 texel = unpackUnorm4x8(a.texels.values[first + uint(repeated.y * size.x + repeated.x)]);
  return isSrgb ? vec4(linearFromSrgb(texel.rgb), texel.a) : texel;
}

// Loops instead of calls for each level, as some drivers take minutes to compile many copies.
vec4 textureColour(ModelTextureArguments a, vec2 where, vec2 alongX, vec2 alongY, bool isSrgb) {
  if (any(isnan(where)) || any(isinf(where))) where = vec2(0);
  const vec2 x = vec2(a.width, a.height) * alongX, y = vec2(a.width, a.height) * alongY;
  const float longest = max(dot(x, x), dot(y, y));
  const float level = longest > 1 ? min(0.5 * log2(longest), a.levels - 1) : 0;  // 0 where it is not a number
  vec4 colour = vec4(0);
  uint first = 0;
  for (uint l = 0; l < a.levels && l < level + 1; ++l) {
    const ivec2 size = ivec2(max(a.width >> l, 1), max(a.height >> l, 1));
    const float weight = 1 - abs(level - l);
    if (weight > 0) {
      const vec2 at = fract(where) * size - 0.5, low = floor(at), share = at - low;
      const ivec2 corner = ivec2(low);
      colour += weight * mix(mix(texelAt(a, first, size, corner, isSrgb),
                                 texelAt(a, first, size, corner + ivec2(1, 0), isSrgb), share.x),
                             mix(texelAt(a, first, size, corner + ivec2(0, 1), isSrgb),
                                 texelAt(a, first, size, corner + ivec2(1, 1), isSrgb), share.x), share.y);
    }
    first += uint(size.x * size.y);
  }
  return colour;
}

void main() {
  DrawModelArguments a = arguments.values;
  const vec2 alongX = dFdx(place), alongY = dFdy(place);
  ModelMaterialArguments m = a.materials.values[material];
  if (!gl_FrontFacing && m.isDoubleSided == 0) discard;
  vec4 base = vec4(m.baseColour[0], m.baseColour[1], m.baseColour[2], m.opacity) * colour;
  // Of base colour, surface and emission.
  const uint textures[3] = uint[](m.texture, m.surfaceTexture, m.emissionTexture);
  vec4 factors[3] = vec4[](vec4(1), vec4(1), vec4(1));
  const uint maps = (m.texture | m.surfaceTexture | m.emissionTexture) != 0 ? 3 : 0;
  for (uint map = 0; map < maps; ++map) {
    if (textures[map] == 0) continue;
    factors[map] = textureColour(a.textures.values[textures[map] - 1], place, alongX, alongY, map != 1);
  }
  base *= factors[0];
  if (base.a < m.cutoff) discard;
  const vec2 surface = vec2(m.roughness, m.metalness) * factors[1].gb;
  const vec3 emission = vec3(m.emission[0], m.emission[1], m.emission[2]) * factors[2].rgb;
  vec3 seen = base.rgb;
  if (m.isLit != 0) {
    const vec3 n = normalize(gl_FrontFacing ? normal : -normal), towardsEye = -normalize(fromEye);
    const vec3 around = mix(kGround, kSky, 0.5 + 0.5 * n.z);
    const vec3 light = kSun / kPi * max(dot(n, kTowardsSun), 0) + (kHemisphere / kPi + kReflected) * around;
    const float up = reflect(-towardsEye, n).z, blur = mix(0.15, 1, surface.x);
    const vec3 mirrored = kReflected * mix(kGround, kSky, smoothstep(-blur, blur, up));
    seen = (1 - surface.y) * base.rgb * light + mix(vec3(0.04), base.rgb, surface.y) * mirrored;
  }
  seen += emission;
  drawnColour = vec4(srgbFromLinear(clamp(seen, 0, 1)), 1);
  drawnDepth = depth;
}

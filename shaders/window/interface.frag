// Text and boxes of Dear ImGui, both textured with its font texture.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "../compute/kernel.glsl"
#include "arguments_window.h"

KERNEL_ARGUMENTS(InterfaceArguments)

layout(location = 0) in vec2 place;
layout(location = 1) in vec4 colour;
layout(location = 0) out vec4 shown;

float texel(InterfaceArguments drawn, ivec2 at) {
  const ivec2 inside = clamp(at, ivec2(0), ivec2(drawn.fontWidth, drawn.fontHeight) - 1);
  const uint index = inside.y * drawn.fontWidth + inside.x;
  return float(drawn.font.values[index / 4] >> (8 * (index % 4)) & 0xff) / 255;
}

void main() {
  InterfaceArguments drawn = arguments.values;
  const vec2 at = place * vec2(drawn.fontWidth, drawn.fontHeight) - 0.5;
  const ivec2 first = ivec2(floor(at));
  const vec2 part = at - first;
  const float upper = mix(texel(drawn, first), texel(drawn, first + ivec2(1, 0)), part.x);
  const float lower = mix(texel(drawn, first + ivec2(0, 1)), texel(drawn, first + ivec2(1, 1)), part.x);
  const float opacity = colour.a * mix(upper, lower, part.y);
  shown = vec4(colour.rgb * opacity, opacity);
}

// Draws an image, scaled to the window's size, over the background.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "../compute/kernel.glsl"
#include "arguments_window.h"

KERNEL_ARGUMENTS(ShowPictureArguments)

layout(location = 0) out vec4 shown;

vec4 pixel(ShowPictureArguments picture, ivec2 at) {
  const ivec2 inside = clamp(at, ivec2(0), ivec2(picture.width, picture.height) - 1);
  const uint index = inside.y * picture.width + inside.x;
  return vec4(picture.colour.values[3 * index], picture.colour.values[3 * index + 1],
              picture.colour.values[3 * index + 2], picture.opacity.values[index]);
}

void main() {
  ShowPictureArguments picture = arguments.values;
  const vec2 size = vec2(picture.width, picture.height), window = vec2(picture.windowWidth, picture.windowHeight);
  const vec2 at = gl_FragCoord.xy / window * size - 0.5;
  const ivec2 first = ivec2(floor(at));
  const vec2 part = at - first;
  const vec4 upper = mix(pixel(picture, first), pixel(picture, first + ivec2(1, 0)), part.x);
  const vec4 lower = mix(pixel(picture, first + ivec2(0, 1)), pixel(picture, first + ivec2(1, 1)), part.x);
  const vec4 colour = mix(upper, lower, part.y);
  const vec3 background = vec3(picture.background[0], picture.background[1], picture.background[2]);
  shown = vec4(colour.rgb + (1 - colour.a) * background, 1);
}

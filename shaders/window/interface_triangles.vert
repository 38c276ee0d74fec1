// The vertices of Dear ImGui.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "../compute/kernel.glsl"
#include "arguments_window.h"

KERNEL_ARGUMENTS(InterfaceArguments)

layout(location = 0) out vec2 place;   // font texture coordinates
layout(location = 1) out vec4 colour;  // not premultiplied

void main() {
  InterfaceArguments drawn = arguments.values;
  const uint index = drawn.firstIndex + gl_VertexIndex;
  const uint word = drawn.indices.values[index / 2];
  const uint first = 5 * (drawn.firstVertex + ((index & 1) == 0 ? word & 0xffff : word >> 16));
  const vec2 position =
      vec2(uintBitsToFloat(drawn.vertices.values[first]), uintBitsToFloat(drawn.vertices.values[first + 1]));
  place = vec2(uintBitsToFloat(drawn.vertices.values[first + 2]), uintBitsToFloat(drawn.vertices.values[first + 3]));
  colour = unpackUnorm4x8(drawn.vertices.values[first + 4]);
  gl_Position = vec4((position - vec2(drawn.low[0], drawn.low[1])) * vec2(drawn.scale[0], drawn.scale[1]) - 1, 0, 1);
}

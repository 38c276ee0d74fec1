// Projects the corners of a model's triangles into a pinhole camera.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "../compute/kernel.glsl"
#include "arguments_world.h"

KERNEL_ARGUMENTS(DrawModelArguments)

layout(location = 0) out vec3 fromEye;  // along the axes of the world
layout(location = 1) out vec3 normal;
layout(location = 2) out vec2 place;
layout(location = 3) out vec4 colour;
layout(location = 4) out float depth;
layout(location = 5) flat out uint material;

vec3 turned(float matrix[9], vec3 x) {
  vec3 y;
  for (uint row = 0; row < 3; ++row) y[row] = dot(vec3(matrix[3 * row], matrix[3 * row + 1], matrix[3 * row + 2]), x);
  return y;
}

void main() {
  DrawModelArguments a = arguments.values;
  const uint first = 10 * a.corners.values[gl_VertexIndex];
  float numbers[10];
  for (uint i = 0; i < 10; ++i) numbers[i] = a.vertices.values[first + i];
  fromEye = turned(a.worldFromModel, vec3(numbers[0], numbers[1], numbers[2])) + vec3(a.shift[0], a.shift[1], a.shift[2]);
  normal = turned(a.normalFromModel, vec3(numbers[3], numbers[4], numbers[5]));
  place = vec2(numbers[6], numbers[7]);
  colour = unpackUnorm4x8(floatBitsToUint(numbers[8]));
  material = floatBitsToUint(numbers[9]);
  const vec3 x = turned(a.cameraFromWorld, fromEye);
  depth = x.z;
  // Depths are 1 at the near plane and 0 at infinity.
  const vec2 size = vec2(a.width, a.height), centre = vec2(a.centre[0], a.centre[1]);
  const vec2 focal = vec2(a.focal[0], a.focal[1]);
  gl_Position = vec4((2 * focal * x.xy + (2 * centre - size) * x.z) / size, a.near, x.z);
}

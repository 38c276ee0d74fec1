// For the tests of src/gpu: writes the data of a triangle's fragment to images or buffers.
#version 460
#extension GL_EXT_buffer_reference : require
#extension GL_GOOGLE_include_directive : require
#include "triangle_arguments.glsl"

layout(location = 0) flat in uvec2 number;
layout(location = 1) in vec4 colour;

#if defined(NUMBERS)
layout(location = 0) out uvec2 drawnNumber;
void main() { drawnNumber = number; }
#elif defined(COLOUR)
layout(location = 0) out vec4 drawnColour;
void main() { drawnColour = colour; }
#elif defined(SEVERAL)
layout(location = 0) out uvec2 drawnNumber;
layout(location = 1) out vec4 drawnColour;
layout(location = 2) out float drawnDepth;
void main() {
  drawnNumber = number;
  drawnColour = colour;
  drawnDepth = gl_FragCoord.z;
}
#elif defined(COVERAGE)
void main() {
  const uint pixel = uint(gl_FragCoord.y) * arguments.width + uint(gl_FragCoord.x);
  atomicAdd(arguments.covered.values[pixel], 1);
  atomicMax(arguments.largest.values[pixel], number.y);
}
#endif

// Copies words, or zeroes them. As it is a kernel, addresses and counts are arguments and not part of recorded
// commands.
#version 460
#extension GL_EXT_buffer_reference : require

layout(local_size_x = 64) in;
layout(constant_id = 0) const uint kFromNowhere = 0;  // 1: write zeros
layout(buffer_reference, std430, buffer_reference_align = 4) buffer Words { uint words[]; };
layout(buffer_reference, std430, buffer_reference_align = 16) readonly buffer Arguments {
  Words from;
  Words to;
  uint count;
};
layout(push_constant, std430) uniform Push { Arguments arguments; };

void main() {
  for (uint i = gl_GlobalInvocationID.x; i < arguments.count; i += gl_NumWorkGroups.x * gl_WorkGroupSize.x) {
    arguments.to.words[i] = kFromNowhere != 0 ? 0 : arguments.from.words[i];
  }
}

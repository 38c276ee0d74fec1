// For the tests of src/gpu: doubles every value in place, then adds kAddend.
#version 460
#extension GL_EXT_buffer_reference : require

layout(local_size_x = 64) in;
layout(constant_id = 0) const uint kAddend = 0;
layout(buffer_reference, std430, buffer_reference_align = 4) buffer Values { uint values[]; };
layout(buffer_reference, std430, buffer_reference_align = 16) readonly buffer Arguments {
  Values values;
  uint count;
};
layout(push_constant, std430) uniform Push { Arguments arguments; };

void main() {
  const uint i = gl_GlobalInvocationID.x;
  if (i < arguments.count) arguments.values.values[i] = 2 * arguments.values.values[i] + kAddend;
}

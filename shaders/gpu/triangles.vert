// For the tests of src/gpu: draws triangles whose indices and vertices are fetched by address.
#version 460
#extension GL_EXT_buffer_reference : require
#extension GL_GOOGLE_include_directive : require
#include "triangle_arguments.glsl"

layout(constant_id = 0) const uint kFirstNumber = 1;
layout(location = 0) flat out uvec2 number;  // of the instance and of the triangle
layout(location = 1) out vec4 colour;

void main() {
  const Vertex vertex = arguments.vertices.values[arguments.indices.values[gl_VertexIndex]];
  number = uvec2(gl_InstanceIndex, kFirstNumber + gl_VertexIndex / 3);
  colour = vertex.colour;
  gl_Position = vertex.position + vec4(arguments.shift * vertex.position.w * gl_InstanceIndex, 0, 0);
}

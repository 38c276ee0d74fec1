// The arguments of triangles.vert and triangles.frag; must match src/gpu/testing/triangle_rasteriser.h.
struct Vertex {
  vec4 position;  // clip space
  vec4 colour;
};
layout(buffer_reference, std430, buffer_reference_align = 16) readonly buffer Vertices { Vertex values[]; };
layout(buffer_reference, std430, buffer_reference_align = 4) readonly buffer Indices { uint values[]; };
layout(buffer_reference, std430, buffer_reference_align = 4) buffer Counters { uint values[]; };
layout(buffer_reference, std430, buffer_reference_align = 16) readonly buffer Arguments {
  Vertices vertices;
  Indices indices;
  Counters covered;  // [height][width], for the coverage variant
  Counters largest;  // [height][width], for the coverage variant
  vec2 shift;        // offset of each instance from the previous one
  uint width;
};
layout(push_constant, std430) uniform Push { Arguments arguments; };

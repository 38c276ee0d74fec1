// What the host hands to triangles.vert and triangles.frag (src/gpu/testing/triangle_rasteriser.h has the same).
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
  Counters covered;  // [height][width], of the coverage variant
  Counters largest;  // likewise
  vec2 shift;        // of each instance against the one before it
  uint width;
};
layout(push_constant, std430) uniform Push { Arguments arguments; };

// Adds each fragment of a part's triangles to the list of its pixel.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "../../compute/kernel.glsl"
#include "arguments_mesh.h"

KERNEL_ARGUMENTS(DrawTrianglesArguments)

layout(location = 0) flat in uint triangle;

void main() {
  MeshViewPointer view = arguments.values.view;
  LayerListArguments lists = view.value.lists;
  const uvec2 at = uvec2(gl_FragCoord.xy);
  if (at.y < lists.firstRow || at.y > lists.lastRow + 1) return;
  const uint node = atomicAdd(lists.counter.values[0], 1);
  if (node >= lists.capacity) return;
  const uint next = atomicExchange(lists.heads.values[at.y * view.value.raster.width + at.x], node + 1);
  lists.nodes.values[node] = LayerNode(next, arguments.values.part, triangle);
}

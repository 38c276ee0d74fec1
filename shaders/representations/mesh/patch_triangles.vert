// Projects the corners of a part's triangles into a raster.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "../../compute/kernel.glsl"
#include "arguments_mesh.h"

KERNEL_ARGUMENTS(DrawTrianglesArguments)

#include "patch_triangles.glsl"

layout(location = 0) flat out uint triangle;
#ifdef PLACES
layout(location = 1) out vec2 place;    // column and row in the patch, 0 to 1
layout(location = 2) out vec3 fromEye;  // scene units
#else
vec3 fromEye;
#endif

void main() {
  MeshViewPointer view = arguments.values.view;
  PlacedPartArguments placed = view.value.parts.values[arguments.values.part];
  triangle = gl_VertexIndex / 3;
  const PatchTriangle of = patchTriangle(placed.part.value.pairs, triangle);
  const uint corner = cornerOfTriangle(of.isSecond, gl_VertexIndex % 3);
#ifdef PLACES
  place = vec2(corner & 1, corner >> 1);
#endif
  const vec3 number = patchCorner(placed.part.value.vertices, of.patchNumber, corner);
  fromEye = vec3(placed.origin[0], placed.origin[1], placed.origin[2]) + placed.step * number;
  RasterArguments raster = view.value.raster;
  vec3 x;
  for (uint row = 0; row < 3; ++row) {
    x[row] = dot(vec3(raster.rasterFromScene[3 * row], raster.rasterFromScene[3 * row + 1],
                      raster.rasterFromScene[3 * row + 2]), fromEye);
  }
  // Depths are 1 at the near plane and 0 at infinity.
  const vec2 size = vec2(raster.width, raster.height), centre = vec2(raster.centre[0], raster.centre[1]);
  const vec2 focal = vec2(raster.focal[0], raster.focal[1]);
  gl_Position = vec4((2 * focal * x.xy + (2 * centre - size) * x.z) / size, raster.near, x.z);
}

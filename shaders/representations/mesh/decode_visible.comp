// One invocation per pixel: the colour of the triangle that is visible in it, which fragments have decoded with DECODED.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "../../compute/kernel.glsl"
#include "arguments_mesh.h"
#include "../../compute/cube_map.glsl"
#include "../../compute/spherical_harmonics.glsl"
#include "../../compute/vectors.glsl"
#include "../../render/view.glsl"

layout(local_size_x = 8, local_size_y = 8) in;
layout(constant_id = 0) const uint kMaxWidth = 17;  // the maximum width of the networks' layers
KERNEL_ARGUMENTS(MeshViewArguments)

#include "../../render/dense_network.glsl"
#include "patch_texels.glsl"
#include "patch_triangles.glsl"
#include "patch_colours.glsl"
#include "raster_position.glsl"

// Returns the direction of a place beside the middle of a pixel; zero outside the lens.
vec3 jitteredDirection(MeshViewArguments a, uint pixel) {
  const vec3 direction = rayDirection(a.view, pixel);
  const uvec2 at = gl_GlobalInvocationID.xy, last = uvec2(a.view.width - 1, a.view.height - 1);
  const uint besides[2] = {at.x < last.x ? pixel + 1 : pixel, at.y < last.y ? pixel + a.view.width : pixel};
  vec3 moved = direction;
  for (uint axis = 0; axis < 2; ++axis) {
    const vec3 beside = rayDirection(a.view, besides[axis]);
    if (beside != vec3(0)) moved += a.jitter[axis] * (beside - direction);
  }
  return direction == vec3(0) ? direction : normalize(moved);
}

void main() {
  MeshViewArguments a = arguments.values;
  uint pixel;
  if (!pixelIndex(a.view, pixel)) return;
  const vec3 direction = jitteredDirection(a, pixel);
  vec3 colour = vec3(0);
  float opacity = 0, distance = 0, noise = 0;
  if (direction != vec3(0)) {
    uvec2 at = gl_GlobalInvocationID.xy;
    if (a.isSamePixels == 0) {
      vec2 position;
      if (!findRasterPosition(a.raster, direction, position)) return;
      at = uvec2(position);
    }
    if (IS_SET(a.solid)) {
      const float solid = uintBitsToFloat(a.solid.values[at.y * a.raster.width + at.x]);
      if (solid > 0) storeSurface(a.view, pixel, 1 / solid);
    }
    const float nearest = uintBitsToFloat(a.nearest.values[at.y * a.raster.width + at.x]);
#ifdef DECODED
    const uint first = 4 * (at.y * a.raster.width + at.x);
    distance = uintBitsToFloat(a.visible.values[first + 3]);
    const uint number = distance > 0 ? 1 : 0;
#else
    const uint first = 2 * (at.y * a.raster.width + at.x), number = a.visible.values[first];
#endif
    if (number > 0) {
#ifdef DECODED
      colour = uintBitsToFloat(uvec3(a.visible.values[first], a.visible.values[first + 1], a.visible.values[first + 2]));
#else
      const uint triangle = a.visible.values[first + 1];
      PlacedPartArguments placed = a.parts.values[number - 1];
      const TriangleHit hit = hitTriangle(placed, triangle, direction);
      const uint patchNumber = patchTriangle(placed.part.value.pairs, triangle).patchNumber;
      colour = decode(placed.part, placeInPatch(placed.part, patchNumber, hit.place), directionHarmonics(direction));
      distance = hit.distance;
#endif
      opacity = 1;
      // A layer is as near as itself, but for rounding errors and jitter.
      if (nearest * distance > 0.999) noise = 1;
    } else if (a.skyEdge > 0 && farthestDistance(a.view, pixel) >= kSceneEnd) {
      colour = skyColour(a, direction);
      opacity = 1;
    }
    if (number == 0 && nearest > 0) noise = 1;
  }
  storePoint(a.view.colour, pixel, colour);
  a.view.opacity.values[pixel] = opacity;
  a.view.depth.values[pixel] = distance * a.view.directions.values[3 * pixel + 2] * a.view.scale;
  a.noise.values[pixel] = noise;
}

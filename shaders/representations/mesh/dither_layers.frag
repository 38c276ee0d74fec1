// Draws those fragments of a part's triangles whose opacity is above the threshold of the pixel, the frame and the patch.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "../../compute/kernel.glsl"
#include "arguments_mesh.h"
#include "../../compute/vectors.glsl"
#include "../../lib/dither_threshold.glsl"
#include "../../render/view_rays.glsl"

KERNEL_ARGUMENTS(DrawTrianglesArguments)

#include "patch_texels.glsl"
#include "patch_triangles.glsl"
#include "ray_limits.glsl"

layout(location = 0) flat in uint triangle;
layout(location = 1) in vec2 place;
layout(location = 2) in vec3 fromEye;
layout(location = 0) out uvec2 visible;

void main() {
  MeshViewPointer view = arguments.values.view;
  const uint number = arguments.values.part;
  PlacedPartArguments placed = view.value.parts.values[number];
  const PatchTriangle of = patchTriangle(placed.part.value.pairs, triangle);
  const float opacity = mixOpacity(placed.part, placeInPatch(placed.part, of.patchNumber, clamp(place, 0, 1)));
  const uvec2 pixel = uvec2(gl_FragCoord.xy);
  const uint rasterPixel = pixel.y * view.value.raster.width + pixel.x;
  const uint layer = 2 * of.patchNumber + (of.isSecond ? 1 : 0) + 0x10001 * number;
  const float distance = length(fromEye);
  float near = view.value.view.near, far = kSceneEnd;
  if (placed.isBackground != 0) near = behindBox(view.value.view, fromEye / distance);
  if (view.value.isSamePixels != 0) far = farthestDistance(view.value.view, rasterPixel);
  if (!(opacity > 0 && distance > near && distance < far && isInCells(placed, fromEye))) discard;
  // Stores take place even if the fragment is hidden.
  if (opacity < 1) atomicMax(view.value.nearest.values[rasterPixel], floatBitsToUint(1 / distance));
  if (opacity <= ditherThreshold(pixel, view.value.frame, layer)) discard;
  visible = uvec2(number + 1, triangle);
}

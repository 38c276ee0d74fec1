// Draws those fragments of a part's triangles whose opacity is above the threshold of the pixel, the frame and the patch:
// which triangle it is, or, with DECODES, its colour and distance.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "../../compute/kernel.glsl"
#include "arguments_mesh.h"
#ifdef DECODES
#include "../../compute/cube_map.glsl"
#include "../../compute/spherical_harmonics.glsl"
#endif
#include "../../compute/vectors.glsl"
#include "../../lib/dither_threshold.glsl"
#include "../../render/view_rays.glsl"

KERNEL_ARGUMENTS(DrawTrianglesArguments)

#ifdef DECODES
layout(constant_id = 0) const uint kMaxWidth = 17;  // the maximum width of the networks' layers
#include "../../render/dense_network.glsl"
#endif
#include "patch_texels.glsl"
#include "patch_triangles.glsl"
#include "ray_limits.glsl"
#ifdef DECODES
#include "patch_colours.glsl"
#endif

layout(location = 0) flat in uint triangle;
layout(location = 1) in vec2 place;
layout(location = 2) in vec3 fromEye;
#ifdef DECODES
layout(location = 0) out vec4 decoded;
#else
layout(location = 0) out uvec2 visible;
#endif

const uint kFadeLayer = 0xfade;  // of the thresholds between contents

void main() {
  MeshViewPointer view = arguments.values.view;
  const uint number = arguments.values.part;
  PlacedPartArguments placed = view.value.parts.values[number];
  const PatchTriangle of = patchTriangle(placed.part.value.pairs, triangle);
  const PatchPlace around = placeInPatch(placed.part, of.patchNumber, clamp(place, 0, 1));
  const float opacity = mixOpacity(placed.part, around);
  const uvec2 pixel = uvec2(gl_FragCoord.xy);
  const uint rasterPixel = pixel.y * view.value.raster.width + pixel.x;
  const uint layer = 2 * of.patchNumber + (of.isSecond ? 1 : 0) + 0x10001 * number;
  const float distance = length(fromEye);
  float near = view.value.view.near, far = kSceneEnd;
  if (placed.isBackground != 0) near = behindBox(view.value.view, fromEye / distance);
  if (view.value.isSamePixels != 0) far = farthestDistance(view.value.view, rasterPixel);
  if (!(opacity > 0 && distance > near && distance < far && isInCells(placed, fromEye))) discard;
  if (isHidden(view.value.view, toVec3(view.value.view.origin) + fromEye, placed.isBackground != 0)) discard;
  // Of two contents that fade into each other, the one that most pixels show gives the solid surface. Stores take place
  // even if the fragment is hidden.
  if (opacity >= 0.5 && IS_SET(view.value.solid) && placed.share[0] <= 0.5 && placed.share[1] > 0.5)
    atomicMax(view.value.solid.values[rasterPixel], floatBitsToUint(1 / distance));
  // Both have the same thresholds, so that each pixel shows one of them.
  const bool isFading = placed.share[1] - placed.share[0] < 1;
  if (isFading) {
    const float threshold = ditherThreshold(pixel, view.value.frame, kFadeLayer);
    if (threshold < placed.share[0] || threshold >= placed.share[1]) discard;
  }
  if (opacity < 1 || isFading) atomicMax(view.value.nearest.values[rasterPixel], floatBitsToUint(1 / distance));
  if (opacity <= ditherThreshold(pixel, view.value.frame, layer)) discard;
#ifdef DECODES
  decoded = vec4(decode(placed.part, around, directionHarmonics(fromEye / distance)), distance);
#else
  visible = uvec2(number + 1, triangle);
#endif
}

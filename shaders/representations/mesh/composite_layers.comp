// One invocation per pixel: sorts the fragments of its list by distance, shades and composites them
// (docs/tile-format.md, section 8). Equal distances are in the order of parts and triangles.
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
#include "ray_limits.glsl"

const uint kBatch = 16;  // hits that are sorted at a time

// Sets `corner` to the first of the raster's pixels around a direction; returns false if the lists do not have them.
bool findRasterPixels(MeshViewArguments a, vec3 direction, out uvec2 corner) {
  corner = gl_GlobalInvocationID.xy;
  if (a.isSamePixels == 0) {
    vec2 position;
    if (!findRasterPosition(a.raster, direction, position)) return false;
    corner = uvec2(position - 0.5);
  }
  return corner.y >= a.lists.firstRow && corner.y <= a.lists.lastRow;
}

struct Layer {
  float distance;
  uint part;
  uint triangle;
  uint phase;  // 1: of the background block, which is behind all else
  vec2 place;
};

// Orders layers that have equal distances by parts and triangles, so that no two are equal.
bool isBefore(Layer a, Layer b) {
  if (a.phase != b.phase) return a.phase < b.phase;
  if (a.distance != b.distance) return a.distance < b.distance;
  return a.part != b.part ? a.part < b.part : a.triangle < b.triangle;
}

// A ray, and what may hit it.
struct RayArguments {
  vec3 direction;
  float far, nearOfBackground;
  uvec2 corner;  // of the raster's pixels that list the triangles
};

// Returns false where the ray does not hit.
bool hitNode(MeshViewArguments a, RayArguments ray, LayerNode node, out Layer layer) {
  PlacedPartArguments placed = a.parts.values[node.part];
  const TriangleHit hit = hitTriangle(placed, node.triangle, ray.direction);
  layer = Layer(hit.distance, node.part, node.triangle, placed.isBackground, hit.place);
  // Where the raster has the same pixels, its rule for edges decides: one of two neighbours is hit, and no gap is left.
  if (a.isSamePixels == 0 && hit.isOutside) return false;
  const float near = placed.isBackground != 0 ? ray.nearOfBackground : a.view.near;
  const vec3 fromEye = hit.distance * ray.direction;
  return hit.distance > near && hit.distance < ray.far && isInCells(placed, fromEye) &&
         !isHidden(a.view, toVec3(a.view.origin) + fromEye, placed.isBackground != 0);
}

// Collects the nearest layers of a ray behind `last` in order; returns their number.
uint findLayers(MeshViewArguments a, RayArguments ray, Layer last, out Layer layers[kBatch]) {
  uint count = 0;
  const uint neighbours = a.isSamePixels != 0 ? 1 : 4;
  for (uint neighbour = 0; neighbour < neighbours; ++neighbour) {
    const uvec2 at = ray.corner + uvec2(neighbour & 1, neighbour >> 1);
    uint number = a.lists.heads.values[at.y * a.raster.width + at.x];
    while (number != 0) {
      LayerNode node = a.lists.nodes.values[number - 1];
      number = node.next;
      Layer layer;
      if (!hitNode(a, ray, node, layer) || !isBefore(last, layer)) continue;
      uint place = count;
      while (place > 0 && isBefore(layer, layers[place - 1])) --place;
      if (place == kBatch) continue;
      // Several pixels of the raster may list the same triangle.
      if (place > 0 && !isBefore(layers[place - 1], layer)) continue;
      count = min(count + 1, kBatch);
      for (uint i = count - 1; i > place; --i) layers[i] = layers[i - 1];
      layers[place] = layer;
    }
  }
  return count;
}

void main() {
  MeshViewArguments a = arguments.values;
  uint pixel;
  if (!pixelIndex(a.view, pixel)) return;
  RayArguments ray;
  ray.direction = rayDirection(a.view, pixel);
  vec3 colour = vec3(0);
  float transmittance = 1, depth = 0;
  bool hasSurface = false;
  if (ray.direction != vec3(0)) {
    if (!findRasterPixels(a, ray.direction, ray.corner)) return;
    ray.far = farthestDistance(a.view, pixel);
    ray.nearOfBackground = behindBox(a.view, ray.direction);
    const Harmonics harmonics = directionHarmonics(ray.direction);
    Layer last = Layer(-1, 0, 0, 0, vec2(0));
    uint count = kBatch;
    while (count == kBatch && transmittance >= a.view.minTransmittance) {
      Layer layers[kBatch];
      count = findLayers(a, ray, last, layers);
      for (uint i = 0; i < count && transmittance >= a.view.minTransmittance; ++i) {
        last = layers[i];
        PlacedPartArguments placed = a.parts.values[last.part];
        const uint patchNumber = patchTriangle(placed.part.value.pairs, last.triangle).patchNumber;
        const PatchPlace around = placeInPatch(placed.part, patchNumber, last.place);
        const float opacity = mixOpacity(placed.part, around);
        if (opacity <= 0) continue;
        if (opacity >= 0.5 && !hasSurface) {
          hasSurface = true;
          storeSurface(a.view, pixel, last.distance);
        }
        const float weight = transmittance * opacity;
        colour += weight * decode(placed.part, around, harmonics);
        depth += weight * last.distance;
        transmittance *= 1 - opacity;
      }
    }
    if (a.skyEdge > 0 && ray.far >= kSceneEnd) {
      colour += transmittance * skyColour(a, ray.direction);
      if (transmittance < 1) depth /= 1 - transmittance;
      transmittance = 0;
    }
  }
  storePoint(a.view.colour, pixel, colour);
  a.view.opacity.values[pixel] = 1 - transmittance;
  a.view.depth.values[pixel] = depth * a.view.directions.values[3 * pixel + 2] * a.view.scale;
}

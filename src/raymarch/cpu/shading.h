// How contents of one representation become the colour of a ray.
#pragma once

#include <array>
#include <cmath>

#include "raymarch/cpu/march.h"
#include "raymarch/cpu/part_path.h"

namespace tessera {

// Of all contents along a ray.
struct DrawnPixel {
  std::array<float, 3> colour = {0, 0, 0};  // premultiplied
  float transmittance = 1;
  float depth = 0;  // scene units along the ray, premultiplied
};

// A ray that ends at a distance in scene units, where something else stands if it is finite.
struct BoundedRay {
  SceneRay ray;
  double far = INFINITY;
};

// Rays that are cast together have the numbers of their lanes.
inline constexpr size_t kRayLanes = 16;

// A ray through one part of a content.
struct PartRay {
  size_t lane;
  const SceneRay* ray;
  RayRange range;
  ContentComposite* composite;  // what the content's parts in front of this one hold; is gone on with
};

// Shading<Content>::Type is made of the contents of a drawing, and is asked for one packet of rays after another:
//   begin(lane, ray)             whether something else is known to be at its end
//   transmittance(lane)          of what has been added so far
//   march(content, part, rays, counts)
//   add(lane, composite, number) of a content, front to back; contents have the numbers of their places in the drawing
//   end(lane, pixel)             the pixel may get its colour as late as in finish()
//   finish()                     after a number of packets
template <class Content>
struct Shading;
template <class Content>
using ShadingOf = typename Shading<Content>::Type;

}  // namespace tessera

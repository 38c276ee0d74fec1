// The interface through which the contents of one representation are turned into the colour of a ray.
#pragma once

#include <array>
#include <cmath>

#include "raymarch/cpu/march.h"
#include "raymarch/cpu/part_path.h"

namespace tessera {

// The result of all contents along a ray.
struct DrawnPixel {
  std::array<float, 3> colour = {0, 0, 0};  // premultiplied
  float transmittance = 1;
  float depth = 0;  // scene units along the ray, premultiplied
};

// A ray that ends at the distance `far`, scene units. If it is finite, an opaque surface is there.
struct BoundedRay {
  SceneRay ray;
  double far = INFINITY;
};

// The number of rays in a packet. Rays of a packet are identified by their lanes, 0 to kRayLanes - 1.
inline constexpr size_t kRayLanes = 16;

// The section of a ray within one part of a content.
struct PartRay {
  size_t lane;
  const SceneRay* ray;
  RayRange range;
  ContentComposite* composite;  // in: of the content's parts in front of this one; out: including it
};

// Shading<Content>::Type is constructed from the contents of a drawing and then processes one packet of rays after
// another:
//   begin(lane, ray)                    starts a ray
//   transmittance(lane)                 returns the transmittance of all contents added so far
//   march(content, part, rays, counts)  marches rays through one part of a content
//   add(lane, composite, number)        adds a content, front to back; `number`: its index in the drawing
//   end(lane, pixel)                    ends a ray; the pixel may receive its colour as late as in finish()
//   finish()                            is called after a number of packets
template <class Content>
struct Shading;
template <class Content>
using ShadingOf = typename Shading<Content>::Type;

}  // namespace tessera

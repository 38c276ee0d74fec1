#include "compute/cube_map.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "compute/cpu/kernels.h"
#include "compute/host_memory.h"

namespace tessera::cpu {
namespace {

constexpr size_t kGrain = 1024;

// Where a direction meets the map: between a row of texels and the next one, and between a column and the next one.
struct CubeMapPlace {
  static constexpr uint32_t kNowhere = 0xffffffff;
  uint32_t row = kNowhere, column = 0;  // the rows of all sides are numbered together
  float nextRow = 0, nextColumn = 0;    // weights
};

CubeMapPlace findPlace(uint32_t resolution, const float* direction) {
  int axis = 0;
  for (const int other : {1, 2})
    if (std::abs(direction[other]) > std::abs(direction[axis])) axis = other;
  CubeMapPlace place;
  const float size = std::abs(direction[axis]);
  if (!(size > 0)) return place;
  const float halfLast = 0.5f * static_cast<float>(resolution - 1);
  const float column = (direction[(axis + 1) % 3] / size + 1) * halfLast;
  const float row = (direction[(axis + 2) % 3] / size + 1) * halfLast;
  const uint32_t rowOfSide = std::min(static_cast<uint32_t>(row), resolution - 2);
  const uint32_t side = 2 * static_cast<uint32_t>(axis) + (direction[axis] < 0 ? 1 : 0);
  place.row = side * resolution + rowOfSide;
  place.column = std::min(static_cast<uint32_t>(column), resolution - 2);
  place.nextRow = row - static_cast<float>(rowOfSide);
  place.nextColumn = column - static_cast<float>(place.column);
  return place;
}

}  // namespace

void run(Context& context, const CubeMapForward& a) {
  CHECK(a.resolution >= 2u);
  const float* directions = hostPointer(a.directions);
  const float* texels = hostPointer(a.texels);
  float* colours = hostPointer(a.colours);
  context.pool.forRanges(hostCount(a.rays), kGrain, [&](size_t begin, size_t end) {
    for (size_t ray = begin; ray < end; ++ray) {
      const CubeMapPlace place = findPlace(a.resolution, directions + 3 * ray);
      float* to = colours + 3 * ray;
      std::fill_n(to, 3, 0.0f);
      if (place.row == CubeMapPlace::kNowhere) continue;
      const float* from = texels + 3 * (size_t{place.row} * a.resolution + place.column);
      for (const float rowWeight : {1 - place.nextRow, place.nextRow}) {
        for (int c = 0; c < 3; ++c)
          to[c] += rowWeight * ((1 - place.nextColumn) * from[c] + place.nextColumn * from[3 + c]);
        from += size_t{3} * a.resolution;
      }
    }
  });
}

void run(Context& context, const CubeMapBackward& a) {
  CHECK(a.resolution >= 2u);
  const float* directions = hostPointer(a.directions);
  const float* opacity = hostPointer(a.opacity);
  const float* gradients = hostPointer(a.rayColourGradients);
  float* sums = hostPointer(a.texelGradients);
  const size_t rays = hostCount(a.rays);
  std::vector<CubeMapPlace> places(rays);
  context.pool.forRanges(rays, kGrain, [&](size_t begin, size_t end) {
    for (size_t ray = begin; ray < end; ++ray) places[ray] = findPlace(a.resolution, directions + 3 * ray);
  });
  // The additions to each texel are in the order of rays for any split, so the split may depend on the number of
  // threads. Every `parts`-th row belongs to one task, because most rays meet the side that is up.
  const size_t parts = context.pool.threads();
  context.pool.run(parts, [&](size_t part, int) {
    for (size_t ray = 0; ray < rays; ++ray) {
      const CubeMapPlace& place = places[ray];
      if (place.row == CubeMapPlace::kNowhere) continue;
      for (const uint32_t next : {0u, 1u}) {
        const size_t row = size_t{place.row} + next;
        if (row % parts != part) continue;
        float* to = sums + 3 * (row * a.resolution + place.column);
        const float transmittance = opacity ? 1 - opacity[ray] : 1;
        const float weight = transmittance * (next ? place.nextRow : 1 - place.nextRow);
        for (int c = 0; c < 3; ++c) {
          const float gradient = weight * gradients[3 * ray + c];
          to[c] += (1 - place.nextColumn) * gradient;
          to[3 + c] += place.nextColumn * gradient;
        }
      }
    }
  });
}

}  // namespace tessera::cpu

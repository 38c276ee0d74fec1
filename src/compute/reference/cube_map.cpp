#include "compute/cube_map.h"

#include <algorithm>
#include <cmath>

#include "compute/reference/convert.h"
#include "compute/reference/functions.h"

namespace tessera::reference {
namespace {

// The number of numbers of a map.
size_t cubeMapNumbers(uint32_t resolution) {
  return size_t{18} * resolution * resolution;
}

Point directionAt(View directions, size_t ray) {
  return {directions[3 * ray], directions[3 * ray + 1], directions[3 * ray + 2]};
}

}  // namespace

std::vector<CubeMapTexel> cubeMapTexels(uint32_t resolution, const Point& direction) {
  CHECK(resolution >= 2u);
  if (direction == Point{}) return {};
  int axis = 0;
  for (const int other : {1, 2})
    if (std::abs(direction[other]) > std::abs(direction[axis])) axis = other;
  const uint32_t side = 2 * axis + (direction[axis] < 0 ? 1 : 0);
  uint32_t first[2];  // column and row
  double between[2];  // how far from there to the next column and row
  for (const int i : {0, 1}) {
    const double place =
        (direction[(axis + 1 + i) % 3] / std::abs(direction[axis]) + 1) / 2 * static_cast<double>(resolution - 1);
    first[i] = std::min(static_cast<uint32_t>(place), resolution - 2);
    between[i] = place - first[i];
  }
  std::vector<CubeMapTexel> texels;
  for (const uint32_t row : {0u, 1u})
    for (const uint32_t column : {0u, 1u})
      texels.push_back({(side * resolution + first[1] + row) * resolution + first[0] + column,
                        (column ? between[0] : 1 - between[0]) * (row ? between[1] : 1 - between[1])});
  return texels;
}

Point cubeMapColour(uint32_t resolution, View texels, const Point& direction) {
  Point colour{};
  for (const CubeMapTexel& texel : cubeMapTexels(resolution, direction))
    for (int channel = 0; channel < 3; ++channel)
      colour[channel] += texel.weight * texels[size_t{3} * texel.number + channel];
  return colour;
}

void run(const CubeMapForward& a) {
  const size_t rays = hostCount(a.rays);
  const Doubles directions = doubles(a.directions, 3 * rays), texels = doubles(a.texels, cubeMapNumbers(a.resolution));
  Doubles colours;
  for (size_t ray = 0; ray < rays; ++ray) {
    const Point colour = cubeMapColour(a.resolution, texels, directionAt(directions, ray));
    colours.insert(colours.end(), colour.begin(), colour.end());
  }
  store(a.colours, colours);
}

void run(const CubeMapBackward& a) {
  const size_t rays = hostCount(a.rays);
  const Doubles directions = doubles(a.directions, 3 * rays), opacity = doubles(a.opacity, rays);
  const Doubles gradients = doubles(a.rayColourGradients, 3 * rays);
  Doubles sums(cubeMapNumbers(a.resolution));
  for (size_t ray = 0; ray < rays; ++ray) {
    const double transmittance = opacity.empty() ? 1 : 1 - opacity[ray];
    for (const CubeMapTexel& texel : cubeMapTexels(a.resolution, directionAt(directions, ray)))
      for (int channel = 0; channel < 3; ++channel)
        sums[size_t{3} * texel.number + channel] += transmittance * texel.weight * gradients[3 * ray + channel];
  }
  add(a.texelGradients, sums);
}

}  // namespace tessera::reference

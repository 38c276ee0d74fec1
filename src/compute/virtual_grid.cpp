#include "compute/virtual_grid.h"

namespace tessera {

uint32_t VirtualGrid::planeTexel(int plane, uint32_t b, uint32_t c) const {
  return voxels * voxels * voxels + (static_cast<uint32_t>(plane) * planes + c) * planes + b;
}

std::array<float, 3> VirtualGrid::texelPosition(uint32_t texel) const {
  const uint32_t v = voxels, p = planes, all = v * v * v;
  const auto centre = [](uint32_t i, uint32_t resolution) {
    return (static_cast<float>(i) + 0.5f) / static_cast<float>(resolution);
  };
  if (texel < all) return {centre(texel % v, v), centre(texel / v % v, v), centre(texel / (v * v), v)};
  const uint32_t inPlanes = texel - all;
  const int plane = static_cast<int>(inPlanes / (p * p));
  std::array<float, 3> position;
  position[plane] = centre(0, p);
  position[plane == 0 ? 1 : 0] = centre(inPlanes % p, p);
  position[plane == 2 ? 1 : 2] = centre(inPlanes / p % p, p);
  return position;
}

}  // namespace tessera

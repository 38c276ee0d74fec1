// For tests: small contents of random texels that satisfy every rule of the format.
#pragma once

#include "base/random.h"
#include "raymarch/content/occupancy_pyramid.h"
#include "raymarch/testing/random_parts.h"
#include "representations/volume/content/volume_content.h"

namespace tessera::tiles_test {

inline VolumePart testPart(uint64_t seed, uint32_t voxels = 16, uint32_t planes = 24) {
  const RandomStream random(seed, 0x711e5);
  uint64_t next = 0;
  VolumePart part;
  part.voxels = voxels;
  part.planes = planes;
  const uint32_t edge = voxels / VolumePart::kMacroblock, cells = planes / VolumePart::kDistanceCell;
  part.macroblocks.assign(size_t{edge} * edge * edge, VolumePart::kEmpty);
  uint32_t stored = 0;
  for (uint32_t& number : part.macroblocks) {
    if (random.below(next++, 3) > 0) number = stored++;
  }
  part.voxelBytes.resize(size_t{stored} * VolumePart::kMacroblockBytes);
  for (uint8_t& byte : part.voxelBytes) byte = static_cast<uint8_t>(random.below(next++, 256));
  for (auto& plane : part.planeBytes) {
    plane.resize(size_t{planes} * planes * VolumePart::kAttributes);
    for (uint8_t& byte : plane) byte = static_cast<uint8_t>(random.below(next++, 256));
  }
  OccupancyBits occupied(cells);
  for (size_t i = 0; i < occupied.count(); ++i) {
    if (random.below(next++, 4) == 0) occupied.set(i);
  }
  part.distances = chebyshevDistances(occupied);
  return part;
}

inline VolumeContent testContent(uint64_t seed, uint32_t parts = 1) {
  VolumeContent content;
  content.network = testNetwork(seed, {34, 16, 16, 3});
  for (uint32_t i = 0; i < parts; ++i) content.parts.push_back(testPart(seed + 100 * i));
  placeInRow(content.parts);
  return content;
}

}  // namespace tessera::tiles_test

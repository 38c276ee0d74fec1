// One content of a `volume` scene in memory (City-on-Web; MERF): the baked texels of one block, or of several merged
// into one coarser level, and the deferred network that shades them. docs/tile-format.md is normative for what stands
// on disk and for what it looks like; this is the same in C++.
#pragma once

#include <optional>
#include <string>

#include "raymarch/content/content_part.h"
#include "tiles/dense_layer.h"

namespace tessera {

struct TileContent;  // tiles/tileset.h

inline constexpr const char* kVolumeName = "volume";  // of the representation, in files

// Where it stands, and its macroblocks of voxels: ContentPart.
//
// An attribute's byte b is q = b / 255; dequantised -featureRange + 2 featureRange q, or with densityRange. A sample
// sums the trilinear mix of voxels and the bilinear mixes of three planes, per attribute, lookups clamped to the grid;
// then density = exp(min(sum - 1, 15)) per scene unit, diffuse colour and features are sigmoid(sum). Where the
// macroblock that holds the sample is empty, nothing is there.
struct VolumePart : ContentPart {
  static constexpr uint32_t kAttributes = 8;  // density, diffuse r g b, 4 features
  static constexpr uint32_t kMacroblockBytes = kStoredTexels * kAttributes;
  static constexpr uint32_t kDistanceCell = 8;  // plane texels along an edge of a cell of `distances`

  uint32_t voxels = 128;  // along an axis; a multiple of kMacroblock
  uint32_t planes = 512;  // along an axis; a multiple of kDistanceCell

  std::vector<uint8_t> voxelBytes;                 // [stored][9][9][9][8]: z, y, x (x fastest), attribute
  std::array<std::vector<uint8_t>, 3> planeBytes;  // [planes][planes][8]: of axes b < c without a: row c, column b
  // [(planes / 8)³], x fastest: 0 where anything may be; else how many cells one may go in any direction, diagonals
  // too, until one of those is met, at most 255 (Chebyshev distance).
  std::vector<uint8_t> distances;

  uint32_t storedMacroblocks() const { return static_cast<uint32_t>(voxelBytes.size() / kMacroblockBytes); }
};

struct VolumeContent {
  static constexpr uint32_t kMostStepsPerTexel = 8;

  float featureRange = 7, densityRange = 14;
  uint32_t stepsPerTexel = 1;  // of a renderer, per texel of the planes
  // 34 → … → 3. Inputs: composited diffuse colour (3) and features (4) of all parts together, then of the direction d
  // of the ray (grid axes, unit) d, sin(2^k d) and cos(2^k d), k = 0 … 3, per k all three components, the sines first.
  std::vector<DenseLayer> network;
  std::vector<VolumePart> parts;  // one; several where blocks are merged
};

// What a content takes in memory: its texels, indices, distances and weights. Renderers' budgets count this.
inline uint64_t bytesInMemory(const VolumeContent& content) {
  uint64_t bytes = sizeof(VolumeContent) + bytesInMemory(content.network);
  for (const VolumePart& part : content.parts) {
    bytes += sizeof(VolumePart) + sizeof(uint32_t) * part.macroblocks.size() + part.voxelBytes.size() +
             part.distances.size();
    for (const std::vector<uint8_t>& plane : part.planeBytes) bytes += plane.size();
  }
  return bytes;
}

// Content::mismatchWith.
std::optional<std::string> mismatchWithTileset(const VolumeContent& content, const TileContent& promised);

}  // namespace tessera

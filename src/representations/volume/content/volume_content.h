// One content of a `volume` scene in memory (City-on-Web; MERF): the baked texels of one block, or of several merged
// into one coarser level, and the deferred network that shades them. docs/tile-format.md is normative for the file and
// for what it looks like; these structs are its equivalent in memory.
#pragma once

#include <optional>
#include <string>

#include "raymarch/content/content_part.h"
#include "tiles/dense_layer.h"

namespace tessera {

struct TileContent;  // tiles/tileset.h

inline constexpr const char* kVolumeName = "volume";  // the name of the representation in files

// ContentPart holds the placement and the macroblocks of voxels.
//
// Byte b of an attribute is q = b / 255 and dequantises to -featureRange + 2 featureRange q, or for the density with
// densityRange. A sample sums, per attribute, the trilinear interpolation of the voxels and the bilinear interpolations
// of the three planes, with lookups clamped to the grid. Then density = exp(min(sum - 1, 15)) per scene unit; diffuse
// colour and features are sigmoid(sum). A sample whose macroblock is empty contributes nothing.
struct VolumePart : ContentPart {
  static constexpr uint32_t kAttributes = 8;  // density, diffuse r g b, 4 features
  static constexpr uint32_t kMacroblockBytes = kStoredTexels * kAttributes;
  static constexpr uint32_t kDistanceCell = 8;  // plane texels along an edge of a cell of `distances`

  uint32_t voxels = 128;  // along an axis; a multiple of kMacroblock
  uint32_t planes = 512;  // along an axis; a multiple of kDistanceCell

  std::vector<uint8_t> voxelBytes;                 // [stored][9][9][9][8]: z, y, x (x fastest), attribute
  std::array<std::vector<uint8_t>, 3> planeBytes;  // [planes][planes][8]: plane a spans the axes b < c: row c, column b
  // [(planes / 8)³], x fastest: 0 in cells that may contain something, else the Chebyshev distance in cells to the
  // nearest of those (diagonal steps count one), at most 255.
  std::vector<uint8_t> distances;

  uint32_t storedMacroblocks() const { return static_cast<uint32_t>(voxelBytes.size() / kMacroblockBytes); }
};

struct VolumeContent {
  static constexpr uint32_t kMaxStepsPerTexel = 8;

  float featureRange = 7, densityRange = 14;
  uint32_t stepsPerTexel = 1;  // steps of a renderer per texel of the planes
  // Layers 34 → … → 3. The inputs are the composited diffuse colour (3) and features (4) of all parts together, then,
  // for the direction d of the ray (grid axes, unit length), d, sin(2^k d) and cos(2^k d), k = 0 … 3, for each k all
  // three components, sines first.
  std::vector<DenseLayer> network;
  std::vector<VolumePart> parts;  // one part, or several where blocks are merged
};

// Returns the bytes that a content takes in memory: its texels, indices, distances and weights. Renderers' budgets
// count these.
inline uint64_t bytesInMemory(const VolumeContent& content) {
  uint64_t bytes = sizeof(VolumeContent) + bytesInMemory(content.network);
  for (const VolumePart& part : content.parts) {
    bytes += sizeof(VolumePart) + sizeof(uint32_t) * part.macroblocks.size() + part.voxelBytes.size() +
             part.distances.size();
    for (const std::vector<uint8_t>& plane : part.planeBytes) bytes += plane.size();
  }
  return bytes;
}

// Implements Content::mismatchWith.
std::optional<std::string> mismatchWithTileset(const VolumeContent& content, const TileContent& declared);

}  // namespace tessera

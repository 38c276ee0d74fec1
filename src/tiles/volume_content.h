// One content of a `volume` scene in memory (City-on-Web; MERF): the baked texels of one block, or of several merged
// into one coarser level, and the deferred network that shades them. docs/tile-format.md is normative for what stands
// on disk and for what it looks like; this is the same in C++.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

namespace tessera {

// outputs = weights · inputs + biases; ReLU after each layer but the last, a sigmoid after that.
struct DenseLayer {
  uint32_t inputs = 0, outputs = 0;
  std::vector<float> weights;  // [outputs][inputs]
  std::vector<float> biases;   // [outputs]
};

// Scene units: those of tileset.json's extension, where half a finest block's edge is 1. Local coordinates are q = (x -
// centre) / scale per axis. A bounded part's domain is [-1,1]³ and holds q; a contracted one's is [-2,2]³ and holds
// scene/contraction.h of q. With h half the domain's size, texel i of R along an axis lies at -h + 2h (i + ½) / R.
//
// An attribute's byte b is q = b / 255; dequantised -featureRange + 2 featureRange q, or with densityRange. A sample
// sums the trilinear mix of voxels and the bilinear mixes of three planes, per attribute, lookups clamped to the grid;
// then density = exp(min(sum - 1, 15)) per scene unit, diffuse colour and features are sigmoid(sum). Where the
// macroblock that holds the sample is empty, nothing is there.
struct VolumePart {
  static constexpr uint32_t kAttributes = 8;  // density, diffuse r g b, 4 features
  static constexpr uint32_t kMacroblock = 8;  // voxels along an edge; stored with one more at the upper end (the apron)
  static constexpr uint32_t kStoredEdge = 9;  // kMacroblock + 1
  static constexpr uint32_t kMacroblockBytes = kStoredEdge * kStoredEdge * kStoredEdge * kAttributes;
  static constexpr uint32_t kEmpty = 0xffffffffu;
  static constexpr uint32_t kDistanceCell = 8;  // plane texels along an edge of a cell of `distances`

  std::array<float, 3> centre = {0, 0, 0}, scale = {1, 1, 1};
  bool contracted = false;
  // What it owns, scene units. The surround owns all that lies outside the scene's box, and is seen behind it only.
  std::array<float, 3> low = {-1, -1, -1}, high = {1, 1, 1};
  bool surround = false;

  uint32_t voxels = 128;  // along an axis; a multiple of kMacroblock
  uint32_t planes = 512;  // along an axis; a multiple of kDistanceCell

  // [(voxels / 8)³], x fastest: the number of a macroblock among those stored, or kEmpty. Macroblock b holds the voxels
  // 8b to 8b + 8 along each axis (the last clamped to the grid), so that a sample whose lower voxel is in it finds its
  // upper ones too.
  std::vector<uint32_t> macroblocks;
  std::vector<uint8_t> voxelBytes;                 // [stored][9][9][9][8]: z, y, x (x fastest), attribute
  std::array<std::vector<uint8_t>, 3> planeBytes;  // [planes][planes][8]: of axes b < c without a: row c, column b
  // [(planes / 8)³], x fastest: 0 where anything may be; else how many cells one may go in any direction, diagonals
  // too, until one of those is met, at most 255 (Chebyshev distance).
  std::vector<uint8_t> distances;

  uint32_t storedMacroblocks() const { return static_cast<uint32_t>(voxelBytes.size() / kMacroblockBytes); }
  float halfDomain() const { return contracted ? 2.0f : 1.0f; }
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
  uint64_t bytes = sizeof(VolumeContent);
  for (const DenseLayer& layer : content.network) {
    bytes += sizeof(DenseLayer) + sizeof(float) * (layer.weights.size() + layer.biases.size());
  }
  for (const VolumePart& part : content.parts) {
    bytes += sizeof(VolumePart) + sizeof(uint32_t) * part.macroblocks.size() + part.voxelBytes.size() +
             part.distances.size();
    for (const std::vector<uint8_t>& plane : part.planeBytes) bytes += plane.size();
  }
  return bytes;
}

}  // namespace tessera

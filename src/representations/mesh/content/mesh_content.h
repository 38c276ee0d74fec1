// One content of a `mesh` scene in memory (Gu et al. 2023, UE4-NeRF, section 3.2): triangles in patches of texels, and
// the networks that turn the features of a texel, seen from a direction, into a colour. docs/tile-format.md, section 8,
// defines what all of it means.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "scene/axes.h"
#include "tiles/dense_layer.h"

namespace tessera {

struct SharedEncoder;  // representations/mesh/content/mesh_encoder.h
struct TileContent;    // tiles/tileset.h

inline constexpr const char* kMeshName = "mesh";  // the name of the representation in files

inline constexpr uint32_t kMeshFeatures = 8;
inline constexpr uint32_t kMeshHarmonics = 9;  // of the direction, inputs of the decoder after the features

// Of SelectionSettings: UE4-NeRF's plugin frees a finer level beyond 1.5 times the distance at which it loads it.
inline constexpr double kMeshHysteresis = 1.5;

// The values that a byte stands for: linear from `low` (0) to `high` (255).
struct FeatureRange {
  float low = 0, high = 1;

  bool operator==(const FeatureRange&) const = default;
  float decode(float byte) const { return low + (high - low) * (byte / 255); }
  // The nearest byte, clamped to the range.
  uint8_t encode(float value) const;
};

struct MeshTexel {
  std::array<float, kMeshFeatures> features{};
  float opacity = 0;
};

// Which encoder gives the texels of a part, and where it is evaluated.
struct PatchEncoder {
  uint32_t resource = 0;                    // number among MeshContent::encoders
  std::array<double, 3> scale{}, offset{};  // of the position in the encoder's unit cube: scale · x + offset, clamped
  uint32_t places = 1;                      // along an edge of a texel, which is their mean: 1, 2 or 4
  float opaqueFrom = 1, transparentBelow = 0;

  bool operator==(const PatchEncoder&) const = default;
};

// The triangles of one block, or of a piece of it, and the network that they share. Patch p is a square of patchEdge²
// texels. Its corners lie at the centres of its outermost texels (0, 0), (T-1, 0), (0, T-1) and (T-1, T-1), as (column,
// row). Its triangles have the corners (0, 1, 2) and (3, 2, 1); patches from `pairs` on have the first alone.
struct PatchSet {
  static constexpr uint32_t kMinPatchEdge = 4, kMaxPatchEdge = 32;
  static constexpr uint32_t kMaxTextureEdge = 4096;         // texels, which every GPU supports
  static constexpr uint32_t kFeatureTextures = 4;           // of two features each
  static constexpr uint32_t kBc4Bytes = 8, kBc5Bytes = 16;  // of a block of 4×4 texels

  uint32_t patchEdge = 8;  // T, a multiple of 4
  uint32_t patches = 0, pairs = 0;
  // The number v of a vertex along an axis stands for origin + step · v, in scene units.
  std::array<double, 3> origin{};
  double step = 1;
  std::vector<uint16_t> vertices;                    // [patches][4][3]
  std::array<FeatureRange, kMeshFeatures> ranges{};  // of the features
  // Textures in blocks, row by row: of features 2k and 2k + 1 in BC5, and of opacities in BC4. Patch p is in row
  // p / patchesAcross() of patches, and in column p % patchesAcross().
  std::array<std::vector<uint8_t>, kFeatureTextures> featureBlocks;
  std::vector<uint8_t> opacityBlocks;
  // Of inferred maps: the textures are empty, or what MapInference has set, and are not written to files.
  std::optional<PatchEncoder> encoder;
  std::vector<DenseLayer> decoder;  // features and harmonics → … → 3

  uint32_t triangles() const { return patches + pairs; }
  uint32_t patchesAcross() const;  // the smallest number whose square is at least `patches`
  uint32_t textureWidth() const { return patchesAcross() * patchEdge; }
  uint32_t textureHeight() const;
  uint64_t textureBlocks() const { return uint64_t{textureWidth()} * textureHeight() / 16; }
  Vec3d corner(uint32_t patch, uint32_t number) const;
};

// Returns the largest number of patches of a part: those that fit a texture, and at most 2^18, so that single precision
// suffices for their numbers.
constexpr uint32_t maxPatches(uint32_t patchEdge) {
  const uint32_t across = PatchSet::kMaxTextureEdge / std::max(patchEdge, 8u);
  return across * across;
}

// Mixes the texels of a patch at a column and a row in [0, T-1].
MeshTexel mixTexels(const PatchSet& set, uint32_t patch, float column, float row);

struct MeshContent {
  bool isBackground = false;
  uint32_t skyEdge = 0;      // R; 0: no sky
  std::vector<uint8_t> sky;  // [6][R][R][3], the texels of CubeMapForward
  std::vector<PatchSet> parts;
  std::vector<std::shared_ptr<const SharedEncoder>> encoders = {};  // the resources of the content

  uint64_t triangles() const;
};

// Returns the colour of the sky in a direction; CHECKs that there is one.
std::array<float, 3> skyColour(const MeshContent& content, const Vec3d& direction);

// Returns the memory of a part in bytes, of which only the numbers of patches and texels and the sizes of the layers
// are read. Outputs of layers count as rounded up to multiples of 8, as renderers round them.
uint64_t patchSetBytes(const PatchSet& set);
// Returns the bytes that a content takes in memory, as counted by the budgets of renderers: with its textures, even if
// they are not inferred yet, and without the encoders, which contents share.
uint64_t bytesInMemory(const MeshContent& content);

// Implements Content::mismatchWith.
std::optional<std::string> mismatchWithTileset(const MeshContent& content, const TileContent& declared);

}  // namespace tessera

// One content of a `hash` scene in memory (NGP-RT): the baked features of one block, or of several merged into one
// coarser level, and the network that turns what a ray adds up to into a colour.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "raymarch/content/content_part.h"
#include "raymarch/content/occupancy_pyramid.h"
#include "representations/hash/content/occupancy_distance.h"
#include "tiles/dense_layer.h"

namespace tessera {

struct TileContent;  // tiles/tileset.h

inline constexpr const char* kHashName = "hash";  // of the representation, in files

// What a byte stands for: evenly from `low` (0) to `high` (255).
struct ByteRange {
  float low = 0, high = 1;
  bool operator==(const ByteRange&) const = default;
  float scale() const { return (high - low) / 255; }
  float valueOf(uint8_t byte) const { return low + scale() * static_cast<float>(byte); }
  uint8_t byteOf(float value) const {  // the nearest
    const float byte = high > low ? (value - low) / scale() + 0.5f : 0.0f;
    return static_cast<uint8_t>(byte < 0 ? 0 : byte > 255 ? 255 : byte);
  }
};

// One level of explicit features: a table in instant-ngp's convention. A sample at p in [0,1]³ of the domain lies at
// (resolution - 1) p + ½ among lattice points; entries of a point: dense (x + r (y + r z), modulo entries) where
// `hashed` is false, else x xor (y · 2654435761) xor (z · 805459861), modulo entries, a power of two.
struct HashTable {
  uint32_t resolution = 0, entries = 0;
  bool hashed = false;
  std::vector<uint8_t> bytes;       // [entries][8]
  std::array<ByteRange, 8> ranges;  // of each feature
};

struct HashPart : ContentPart {
  static constexpr uint32_t kFeatures = 8;  // logarithm of density, diffuse r g b, 4 features
  static constexpr uint32_t kMostTables = 8;
  static constexpr float kMostLogDensity = 15;
  static constexpr double kLongestStep = 1e3;    // that counts, scene units: what lies outermost is endlessly long
  static constexpr uint32_t kOccupancyUnit = 8;  // of which cells along an edge are a multiple

  // Coarse features, and logits where weights vary, at `lattice`³ corners, corner i at (i + ½) / lattice of the domain,
  // in macroblocks: [stored][9][9][9][columns].
  uint32_t lattice = 128;         // a multiple of 8
  uint32_t columns = kFeatures;   // or twice as many where there are logits; what is left over means nothing
  std::vector<ByteRange> ranges;  // [columns]
  std::vector<uint8_t> cornerBytes;
  std::vector<HashTable> tables;  // fine levels

  // Where anything is seen, cells³ of the domain; levels[0] is the finest. All corners that samples there mix are
  // stored.
  OccupancyPyramid occupied;
  OctantDistances distances;  // of it: what a ray may pass over

  uint32_t cells() const { return occupied.levels.front().cells; }
  uint32_t storedMacroblocks() const {
    return static_cast<uint32_t>(cornerBytes.size() / (size_t{kStoredTexels} * columns));
  }
};

// What weighs a fine level: nothing, one logit of a sigmoid, or one for density and one for colours.
enum class LevelWeights { none, shared, separate };
const char* nameOf(LevelWeights weights);
std::optional<LevelWeights> levelWeightsFrom(std::string_view name);

struct HashContent {
  LevelWeights weights = LevelWeights::separate;
  // Where they are the same everywhere; else parts have them in their columns. [levels], or [levels][2].
  std::vector<float> logits;
  float step = 0;        // of a ray, as a share of the width of a domain
  bool isWhole = false;  // rays that end nowhere show what the network says of their direction
  // 23 → … → 3 without a sigmoid, biases zero or not. Inputs: composited diffuse colour (3) and features (4), then 16
  // spherical harmonics of the ray's direction.
  std::vector<DenseLayer> network;
  std::vector<HashPart> parts;

  uint32_t logitsOfLevel() const { return weights == LevelWeights::none ? 0 : weights == LevelWeights::shared ? 1 : 2; }
  // Of a part.
  uint32_t columns() const {
    return weights == LevelWeights::none || !logits.empty() ? HashPart::kFeatures : 2 * HashPart::kFeatures;
  }
};

// What a part takes in memory that has so many macroblocks, cells along an edge, and near cells (OctantDistances), all
// else being there or not.
uint64_t hashPartBytes(const HashPart& part, uint64_t storedMacroblocks, uint32_t cells, uint64_t nearCells);
// What a content takes in memory. Renderers' budgets count this.
uint64_t bytesInMemory(const HashContent& content);

// Content::mismatchWith.
std::optional<std::string> mismatchWithTileset(const HashContent& content, const TileContent& promised);

}  // namespace tessera

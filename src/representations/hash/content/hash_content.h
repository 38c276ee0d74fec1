// One content of a `hash` scene in memory (NGP-RT): the baked features of one block, or of several blocks merged into a
// coarser level of detail, and the network that turns the features composited along a ray into a colour.
#pragma once

#include <algorithm>
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

inline constexpr const char* kHashName = "hash";  // the name of the representation in files

// The range that a byte quantises: linear from `low` (byte 0) to `high` (byte 255).
struct ByteRange {
  float low = 0, high = 1;
  bool operator==(const ByteRange&) const = default;
  float scale() const { return (high - low) / 255; }
  float decodeByte(uint8_t byte) const { return low + scale() * static_cast<float>(byte); }
  uint8_t encodeByte(float value) const {  // the nearest byte, clamped to the range
    const float byte = scale() > 0 ? (value - low) / scale() + 0.5f : 0.0f;
    return static_cast<uint8_t>(byte >= 0 ? std::min(byte, 255.0f) : 0.0f);  // 0 for what is not a number
  }
};

// One level of explicit features: a table in the convention of Instant-NGP. A sample at p in [0,1]³ of the domain has
// the coordinates (resolution - 1) p + ½ on the grid of points. The entry of a point (x, y, z) is
// x + r (y + r z) modulo `entries` where `hashed` is false (r = resolution), otherwise
// x xor (y · 2654435761) xor (z · 805459861) modulo `entries`, which then is a power of two.
struct HashTable {
  uint32_t resolution = 0, entries = 0;
  bool hashed = false;
  std::vector<uint8_t> bytes;       // [entries][8]
  std::array<ByteRange, 8> ranges;  // one for each feature
};

struct HashPart : ContentPart {
  static constexpr uint32_t kFeatures = 8;  // log density, diffuse r g b, 4 features
  static constexpr uint32_t kMaxTables = 8;
  static constexpr float kMaxLogDensity = 15;
  // Scene units. Longer steps count as this long, because the outermost step of a contracted domain has no end.
  static constexpr double kLongestStep = 1e3;
  static constexpr uint32_t kOccupancyUnit = 8;  // the number of cells along an edge is a multiple of this

  // Coarse features, and logits where weights vary, at `lattice`³ corners, stored in macroblocks:
  // [stored][9][9][9][columns]. Corner i lies at (i + ½) / lattice of the domain.
  uint32_t lattice = 128;         // a multiple of 8
  uint32_t columns = kFeatures;   // or twice as many where there are logits; surplus columns are unused
  std::vector<ByteRange> ranges;  // [columns]
  std::vector<uint8_t> cornerBytes;
  std::vector<HashTable> tables;  // one for each fine level

  // The cells of the domain in which anything can be seen, cells³; levels[0] is the finest. All lattice corners that a
  // sample in an occupied cell interpolates are stored.
  OccupancyPyramid occupied;
  OctantDistanceField distances;  // derived from `occupied`: how far a ray may skip

  uint32_t cells() const { return occupied.levels.front().cells; }
  uint32_t storedMacroblocks() const {
    return static_cast<uint32_t>(cornerBytes.size() / (size_t{kStoredTexels} * columns));
  }
};

// The attention weights of a fine level: none, one (the sigmoid of a logit), or one for density and one for colours.
enum class LevelWeights { none, shared, separate };
const char* levelWeightsName(LevelWeights weights);
std::optional<LevelWeights> levelWeightsFrom(std::string_view name);

struct HashContent {
  LevelWeights weights = LevelWeights::separate;
  // The logits if they are the same everywhere: [levels], or [levels][2]. If empty, parts store them in their columns.
  std::vector<float> logits;
  float step = 0;                     // step length of a ray, as a fraction of the width of a domain
  bool hasLearnedBackground = false;  // rays that hit nothing show the network's output for their direction
  // A network 23 → … → 3 without a final sigmoid; biases may be zero. Its inputs are the composited diffuse colour (3),
  // the composited features (4), and 16 spherical harmonics of the ray's direction.
  std::vector<DenseLayer> network;
  std::vector<HashPart> parts;

  uint32_t logitsOfLevel() const { return weights == LevelWeights::none ? 0 : weights == LevelWeights::shared ? 1 : 2; }
  // The number of columns that each part has.
  uint32_t columns() const {
    return weights == LevelWeights::none || !logits.empty() ? HashPart::kFeatures : 2 * HashPart::kFeatures;
  }
};

// Returns the bytes that a part takes in memory with the given number of stored macroblocks, occupancy cells along an
// edge and near cells (OctantDistanceField). Only the header fields of `part` need to be set, not its arrays of bytes.
uint64_t hashPartBytes(const HashPart& part, uint64_t storedMacroblocks, uint32_t cells, uint64_t nearCells);
// Returns the bytes that a content takes in memory, as counted by the budgets of renderers.
uint64_t bytesInMemory(const HashContent& content);

// Implements Content::mismatchWith.
std::optional<std::string> mismatchWithTileset(const HashContent& content, const TileContent& declared);

}  // namespace tessera

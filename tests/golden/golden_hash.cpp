#include "golden/golden_hash.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "base/random.h"
#include "representations/hash/content/occupancy_distance.h"

namespace tessera::golden {
namespace {

// Returns the logarithm of the density, followed by seven sums of colours and features.
std::array<double, 8> featuresAt(const Triple<double>& p) {
  std::array<double, 8> features;
  features[0] = logDensityAt(p);
  for (uint64_t a = 0; a < 7; ++a) features[a + 1] = 2 * noise(20 + a, 2 * p[0] + p[2], 2 * p[1]);
  return features;
}

struct Sizes {
  uint32_t lattice, cells;
  std::vector<HashTable> tables;  // their bytes are still empty
};

const Sizes kFine = {32, 32, {{12, 1728, false, {}, {}}, {48, 1024, true, {}, {}}}};
// The number of cells is so large that distances are stored in two grids, one twice or four times as fine as the other.
const Sizes kCoarse = {16, 160, {{24, 512, true, {}, {}}, {32, 512, true, {}, {}}}};
const Sizes kCoarseBackgroundBlock = {16, 288, kCoarse.tables};

class HashPartMaker {
 public:
  HashPartMaker(HashPart& part, const Sizes& sizes, uint32_t columns, uint64_t seed)
      : part_(part), sizes_(sizes), random_(seed, 11), corners_(part, sizes.lattice) {
    part_.lattice = sizes.lattice;
    part_.columns = columns;
  }

  void make() {
    makeRanges();
    makeCorners();
    makeTables();
    makeOccupied();
  }

 private:
  void makeRanges() {
    part_.ranges.assign(part_.columns, {-4, 4});
    part_.ranges[0] = {-12.5f, 6.25f};
    for (size_t f = 1; f < 8; ++f) part_.ranges[f] = {-2, 2.5f};
  }

  void makeCorners() {
    constexpr uint32_t kEdge = HashPart::kMacroblock;
    const uint32_t edge = part_.lattice / kEdge, maximum = part_.lattice - 1;
    uint32_t stored = 0;
    for (uint32_t b = 0; b < edge * edge * edge; ++b) {
      const Triple<uint32_t> first = {kEdge * (b % edge), kEdge * (b / edge % edge), kEdge * (b / edge / edge)};
      const bool requested = corners_.isAnythingIn(first, {first[0] + kEdge, first[1] + kEdge, first[2] + kEdge});
      part_.macroblocks.push_back(requested ? stored++ : HashPart::kEmpty);
      for (uint32_t i = 0; requested && i < HashPart::kStoredTexels; ++i) {
        const Triple<uint32_t> corner = {std::min(first[0] + i % 9, maximum), std::min(first[1] + i / 9 % 9, maximum),
                                         std::min(first[2] + i / 81, maximum)};
        const Triple<double> p = placeOfTexel(part_, corner, part_.lattice);
        const std::array<double, 8> features = featuresAt(p);
        for (size_t f = 0; f < 8; ++f) {
          part_.cornerBytes.push_back(part_.ranges[f].encodeByte(static_cast<float>(features[f])));
        }
        for (uint64_t c = 8; c < part_.columns; ++c) {
          const double logit = 3 * noise(60 + c, 3 * p[0] - p[2], 3 * p[1]);
          part_.cornerBytes.push_back(part_.ranges[c].encodeByte(static_cast<float>(logit)));
        }
      }
    }
  }

  void makeTables() {
    uint64_t next = 0;
    for (HashTable table : sizes_.tables) {
      table.ranges.fill({-1.25f, 1});
      table.ranges[0] = {-0.5f, 0.75f};
      for (uint32_t i = 0; i < 8 * table.entries; ++i) {
        table.bytes.push_back(static_cast<uint8_t>(random_.below(next++, 256)));
      }
      part_.tables.push_back(std::move(table));
    }
  }

  // A cell is occupied if a corner that is interpolated into one of its samples is dense and not merely hidden.
  void makeOccupied() {
    OccupancyBits occupied(sizes_.cells);
    // The samples of a cell interpolate the corners from the lower neighbour of its lower side to the upper neighbour
    // of its upper side. Many cells use the same ranges.
    const double side = static_cast<double>(part_.lattice) / sizes_.cells;
    std::vector<std::array<uint32_t, 2>> ranges;
    std::vector<size_t> rangeIndices;
    for (uint32_t i = 0; i < sizes_.cells; ++i) {
      const std::array<uint32_t, 2> range = {static_cast<uint32_t>(std::max(0.0, std::floor(side * i - 0.5))),
                                             static_cast<uint32_t>(std::floor(side * (i + 1) - 0.5)) + 1};
      if (ranges.empty() || ranges.back() != range) ranges.push_back(range);
      rangeIndices.push_back(ranges.size() - 1);
    }
    std::vector<bool> isAnything;
    for (const auto& z : ranges) {
      for (const auto& y : ranges) {
        for (const auto& x : ranges)
          isAnything.push_back(corners_.isAnythingIn({x[0], y[0], z[0]}, {x[1], y[1], z[1]}));
      }
    }
    for (uint32_t z = 0; z < sizes_.cells; ++z) {
      for (uint32_t y = 0; y < sizes_.cells; ++y) {
        for (uint32_t x = 0; x < sizes_.cells; ++x) {
          const size_t n = ranges.size();
          if (isAnything[rangeIndices[x] + n * (rangeIndices[y] + n * rangeIndices[z])])
            occupied.set(occupied.number(x, y, z));
        }
      }
    }
    part_.occupied = pyramidFromOccupancy(std::move(occupied));
    part_.distances = octantDistances(part_.occupied);
  }

  HashPart& part_;
  const Sizes& sizes_;
  RandomStream random_;
  Densities corners_;
};

HashContent makeGoldenContent(uint64_t seed, LevelWeights weights, bool varies, const Sizes& sizes,
                              const std::vector<HashPart>& parts) {
  HashContent content;
  content.weights = weights;
  content.step = 1.0f / static_cast<float>(2 * sizes.lattice);
  const RandomStream random(seed, 7);
  uint64_t next = 0;
  content.network = makeNetwork(23, random, next);
  for (size_t i = 0; !varies && i < sizes.tables.size() * content.logitsOfLevel(); ++i) {
    content.logits.push_back(2 * random.uniform(next++) - 1);
  }
  content.parts = parts;
  for (HashPart& part : content.parts) HashPartMaker(part, sizes, content.columns(), seed).make();
  return content;
}

HashPart blockPart(uint32_t column) {
  HashPart part;
  placeBlock(part, column);
  return part;
}

HashPart backgroundBlockPart() {
  HashPart part;
  placeBackgroundBlock(part);
  return part;
}

}  // namespace

Scene<HashContent> makeHashScene() {
  Scene<HashContent> scene;
  scene.tileset = landscapeTileset(kHashName, 64);
  scene.contents["0_0"] = makeGoldenContent(1, LevelWeights::separate, true, kFine, {blockPart(0)});
  scene.contents["1_0"] = makeGoldenContent(2, LevelWeights::shared, true, kFine, {blockPart(1)});
  scene.contents["all"] = makeGoldenContent(3, LevelWeights::separate, false, kCoarse, {blockPart(0), blockPart(1)});
  scene.contents["background_block"] =
      makeGoldenContent(4, LevelWeights::separate, true, kFine, {backgroundBlockPart()});
  scene.contents["coarse_background_block"] =
      makeGoldenContent(5, LevelWeights::none, false, kCoarseBackgroundBlock, {backgroundBlockPart()});
  return scene;
}

HashSums computeSums(const HashPart& part) {
  HashSums sums;
  sums.stored = part.storedMacroblocks();
  const auto first = std::find(part.macroblocks.begin(), part.macroblocks.end(), 0u);
  sums.firstStored = static_cast<uint64_t>(first - part.macroblocks.begin());
  for (const uint64_t word : part.occupied.levels[0].words) sums.occupied += static_cast<uint64_t>(std::popcount(word));
  const auto addDistances = [&](uint32_t word) {
    for (uint32_t octant = 0; octant < 8; ++octant) sums.distances += octantDistance(word, octant);
  };
  for (const uint32_t word : part.distances.coarse) {
    if (OctantDistanceField::isEmpty(word)) addDistances(word);
  }
  for (const uint32_t word : part.distances.fine) addDistances(word);
  sums.corners = computeSums(part.cornerBytes);
  for (const HashTable& table : part.tables) sums.tables.push_back(computeSums(table.bytes));
  return sums;
}

nlohmann::ordered_json toJson(const HashSums& sums) {
  nlohmann::ordered_json tables, tablesOrdered;
  for (const ByteSums& table : sums.tables) {
    tables.push_back(table.sum);
    tablesOrdered.push_back(table.ordered);
  }
  return {{"stored", sums.stored},
          {"firstStored", sums.firstStored},
          {"occupied", sums.occupied},
          {"distances", sums.distances},
          {"corners", sums.corners.sum},
          {"cornersOrdered", sums.corners.ordered},
          {"tables", tables},
          {"tablesOrdered", tablesOrdered}};
}

}  // namespace tessera::golden

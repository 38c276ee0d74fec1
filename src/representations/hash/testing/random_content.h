// For tests: small contents of random features.
#pragma once

#include "base/random.h"
#include "raymarch/testing/random_parts.h"
#include "representations/hash/content/hash_content.h"

namespace tessera::tiles_test {

struct TestHashContent {
  uint32_t lattice = 16, cells = 16, levels = 2, entries = 512;
  LevelWeights weights = LevelWeights::separate;
  bool varies = true;
};

inline HashPart testHashPart(uint64_t seed, const TestHashContent& options, uint32_t columns) {
  const RandomStream random(seed, 0x4a54);
  uint64_t next = 0;
  HashPart part;
  part.lattice = options.lattice;
  part.columns = columns;
  const auto range = [&] {
    const float low = random.uniform(next++) - 1;
    return ByteRange{low, low + 2 * random.uniform(next++)};
  };
  for (uint32_t c = 0; c < columns; ++c) part.ranges.push_back(range());
  const uint32_t edge = options.lattice / HashPart::kMacroblock;
  part.macroblocks.assign(size_t{edge} * edge * edge, HashPart::kEmpty);
  uint32_t stored = 0;
  for (uint32_t& number : part.macroblocks) {
    if (random.below(next++, 3) > 0) number = stored++;
  }
  const auto bytes = [&](size_t count) {
    std::vector<uint8_t> all(count);
    for (uint8_t& byte : all) byte = static_cast<uint8_t>(random.below(next++, 256));
    return all;
  };
  part.cornerBytes = bytes(size_t{stored} * HashPart::kStoredTexels * columns);
  for (uint32_t l = 0; l < options.levels; ++l) {
    HashTable table;
    table.resolution = l == 0 ? 8 : options.lattice << l;
    table.entries = options.entries;
    table.hashed = l > 0;
    for (ByteRange& one : table.ranges) one = range();
    table.bytes = bytes(size_t{table.entries} * HashPart::kFeatures);
    part.tables.push_back(std::move(table));
  }
  OccupancyBits occupied(options.cells);
  for (size_t i = 0; i < occupied.count(); ++i) {
    if (random.below(next++, 20) == 0) occupied.set(i);
  }
  part.occupied = pyramidFromOccupancy(std::move(occupied));
  part.distances = octantDistances(part.occupied);
  return part;
}

// Returns a random content that satisfies every rule of the format.
inline HashContent testHashContent(uint64_t seed, uint32_t parts = 1, const TestHashContent& options = {}) {
  HashContent content;
  content.weights = options.weights;
  content.step = 0.01f;
  content.network = testNetwork(seed, {23, 16, 16, 3});
  if (!options.varies) content.logits.assign(size_t{options.levels} * content.logitsOfLevel(), 0.25f);
  for (uint32_t i = 0; i < parts; ++i) {
    content.parts.push_back(testHashPart(seed + 100 * i, options, content.columns()));
  }
  placeInRow(content.parts);
  return content;
}

}  // namespace tessera::tiles_test

#include "representations/hash/content/hash_content.h"

namespace tessera {
namespace {

constexpr const char* kNames[] = {"none", "shared", "separate"};

}  // namespace

const char* levelWeightsName(LevelWeights weights) {
  return kNames[static_cast<size_t>(weights)];
}

std::optional<LevelWeights> levelWeightsFrom(std::string_view name) {
  for (const LevelWeights weights : {LevelWeights::none, LevelWeights::shared, LevelWeights::separate}) {
    if (name == levelWeightsName(weights)) return weights;
  }
  return std::nullopt;
}

uint64_t hashPartBytes(const HashPart& part, uint64_t storedMacroblocks, uint32_t cells, uint64_t nearCells) {
  const auto cube = [](uint64_t edge) { return edge * edge * edge; };
  uint64_t bytes = sizeof(HashPart) + sizeof(ByteRange) * part.ranges.size() +
                   sizeof(uint32_t) * cube(part.lattice / HashPart::kMacroblock) +
                   storedMacroblocks * HashPart::kStoredTexels * part.columns;
  for (const HashTable& table : part.tables) {
    bytes += sizeof(HashTable) + uint64_t{table.entries} * HashPart::kFeatures;
  }
  const uint64_t ratio = OctantDistanceField::ratioFor(cells);
  bytes += sizeof(uint32_t) * (cube(cells / ratio) + (ratio > 1 ? nearCells * cube(ratio) : 0));
  for (uint32_t edge = cells;; edge = (edge + 1) / 2) {
    bytes += sizeof(OccupancyBits) + sizeof(uint64_t) * ((cube(edge) + 63) / 64);
    if (edge <= 1) return bytes;
  }
}

uint64_t bytesInMemory(const HashContent& content) {
  uint64_t bytes = sizeof(HashContent) + sizeof(float) * content.logits.size() + bytesInMemory(content.network);
  for (const HashPart& part : content.parts)
    bytes += hashPartBytes(part, part.storedMacroblocks(), part.cells(), part.distances.nearCells());
  return bytes;
}

}  // namespace tessera

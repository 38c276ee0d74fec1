// The rules that a hash content must satisfy when it is written or read (docs/tile-format.md, section 7).
#include <algorithm>
#include <bit>
#include <cmath>

#include "raymarch/content/content_rules.h"
#include "representations/hash/content/hash_payload.h"

namespace tessera {
namespace {

constexpr uint32_t kInputs = 23, kOutputs = 3;

template <class Ranges>
bool areRanges(const Ranges& ranges) {
  return std::all_of(ranges.begin(), ranges.end(), [](const ByteRange& range) {
    return range.low >= -kLargestFeature && range.low <= range.high && range.high <= kLargestFeature;
  });
}

Broken ruleOfTable(const HashTable& table) {
  if (table.resolution < 2 || table.resolution > kMaxTableResolution)
    return "the resolution of a table is out of bounds";
  if (table.entries < 1 || table.entries > kMaxTableEntries) return "a table has no entries, or too many";
  if (table.hashed && !std::has_single_bit(table.entries))
    return "the entries of a hashed table are not a power of two";
  const uint64_t points = uint64_t{table.resolution} * table.resolution * table.resolution;
  if (!table.hashed && table.entries < points) return "a table that is not hashed has fewer entries than points";
  if (!areRanges(table.ranges)) return "a range is out of bounds";
  if (table.bytes.size() != uint64_t{table.entries} * HashPart::kFeatures)
    return "a table has the wrong number of entries";
  return std::nullopt;
}

Broken ruleOfPart(const HashContent& content, const HashPart& part) {
  if (part.lattice % HashPart::kMacroblock != 0 || part.lattice < 1 || part.lattice > kMaxLattice) {
    return "its lattice is out of bounds";
  }
  if (part.columns != content.columns()) return "its columns are not those that its weights need";
  if (part.ranges.size() != part.columns) return "its ranges are not those of its columns";
  if (!areRanges(part.ranges)) return "a range is out of bounds";
  if (auto broken = ruleOfPlace(part)) return broken;
  if (auto broken = ruleOfMacroblocks(part, part.lattice, part.cornerBytes.size(), part.columns)) return broken;
  if (part.tables.empty() || part.tables.size() > kMaxTables) return "it has no tables, or too many";
  if (part.tables.size() != content.parts.front().tables.size()) return "parts differ in their number of tables";
  for (const HashTable& table : part.tables) {
    if (auto broken = ruleOfTable(table)) return broken;
  }
  if (part.occupied.levels.empty()) return "its occupancy is out of bounds";
  const uint32_t cells = part.cells();
  if (cells % HashPart::kOccupancyUnit != 0 || cells < 1 || cells > kMaxOccupancyCells ||
      part.occupied.levels.size() <= static_cast<size_t>(std::countr_zero(OctantDistanceField::kMaxRatio))) {
    return "its occupancy is out of bounds";
  }
  const uint32_t ratio = OctantDistanceField::ratioFor(cells);
  if (part.distances.ratio != ratio || part.distances.cells != cells / ratio ||
      part.distances.coarse.size() != size_t{cells / ratio} * (cells / ratio) * (cells / ratio) ||
      part.distances.nearCells() != countNearCells(part.occupied)) {
    return "its distances are not those of its cells";
  }
  return std::nullopt;
}

}  // namespace

std::optional<std::string> mismatchWithTileset(const HashContent& content, const TileContent& declared) {
  return mismatchOfParts(content.parts, declared);
}

std::optional<std::string> validationError(const HashContent& content) {
  if (!(content.step >= kShortestHashStep && content.step <= kLongestHashStep)) return "the step is out of bounds";
  if (auto broken = ruleOfNetwork(content.network, kInputs, kOutputs)) return broken;
  if (content.parts.empty()) return "there are no parts";
  const size_t logits = content.parts.front().tables.size() * content.logitsOfLevel();
  if (content.logits.empty() ? logits > HashPart::kFeatures : logits != content.logits.size()) {
    return "its logits are not those of its tables";
  }
  for (const float logit : content.logits) {
    if (!(std::abs(logit) <= kLargestLogit)) return "a logit is out of bounds";
  }
  return ruleOfParts(content.parts, [&](const HashPart& part) { return ruleOfPart(content, part); });
}

}  // namespace tessera

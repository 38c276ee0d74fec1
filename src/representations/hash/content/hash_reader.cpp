// Decodes hash contents from untrusted bytes.
#include "raymarch/content/content_reader.h"
#include "representations/hash/content/hash_payload.h"
#include "representations/hash/content/occupancy_distance.h"
#include "tiles/json_fields.h"

namespace tessera {
namespace {

using namespace json_fields;

bool takeRange(const json& source, ByteRange& range) {
  const auto ends = numbersFrom<2>(source);
  if (!ends) return false;
  range.low = static_cast<float>((*ends)[0]);
  range.high = static_cast<float>((*ends)[1]);
  return true;
}

// The header of a part, which is read before anything is allocated for the part.
struct PartHeader {
  HashPart part;  // without its arrays of bytes
  uint32_t stored = 0, cells = 0, nearCells = 0;

  uint64_t bytes() const { return hashPartBytes(part, stored, cells, nearCells); }
};

class HashReader : public PartsReader<HashReader, HashContent, PartHeader> {
 public:
  using PartsReader::PartsReader;

  bool readSettings() {
    const std::string* weights = getString(file_.ours, "weights");
    const auto known = weights ? levelWeightsFrom(*weights) : std::nullopt;
    const auto step = getNumber(file_.ours, "step");
    if (getField(file_.ours, "whole")) return fail("the key whole is called learned_background now");
    const auto learnedBackground = getBoolean(file_.ours, "learned_background");
    if (!known || !step || !learnedBackground)
      return fail("weights, step or learned_background is missing or malformed");
    content_.weights = *known;
    content_.step = static_cast<float>(*step);
    content_.hasLearnedBackground = *learnedBackground;
    if (!getField(file_.ours, "logits")) return true;
    const json* logits = getArray(file_.ours, "logits");
    if (!logits || logits->empty() || logits->size() > 2 * kMaxTables)
      return fail("its logits are not a list, or their number is out of bounds");
    for (const json& source : *logits) {
      const auto logit = numberFrom(source);
      if (!logit) return fail("a logit is not a number");
      content_.logits.push_back(static_cast<float>(*logit));
    }
    return true;
  }

  bool readHeader(const json& source, PartHeader& header) const {
    HashPart& part = header.part;
    const auto lattice = getUnsigned(source, "lattice", kMaxLattice),
               cells = getUnsigned(source, "cells", kMaxOccupancyCells);
    const auto stored = readStoredCount(source);
    if (!lattice || !cells || !stored) return false;
    if (*lattice < 1 || *lattice % HashPart::kMacroblock != 0) return false;
    if (*cells < 1 || *cells % HashPart::kOccupancyUnit != 0) return false;
    part.lattice = *lattice;
    part.columns = content_.columns();
    header.stored = *stored;
    header.cells = *cells;
    if (const uint32_t ratio = OctantDistanceField::ratioFor(*cells); ratio > 1) {
      const uint64_t edge = *cells / ratio;
      const auto nearCells = getUnsigned(source, "nearCells", static_cast<uint32_t>(edge * edge * edge));
      if (!nearCells) return false;
      header.nearCells = *nearCells;
    }
    const json* ranges = getArray(source, "ranges");
    if (!ranges || ranges->size() != part.columns) return false;
    part.ranges.resize(part.columns);
    for (uint32_t c = 0; c < part.columns; ++c) {
      if (!takeRange((*ranges)[c], part.ranges[c])) return false;
    }
    const json* tables = getArray(source, "tables");
    if (!tables || tables->empty() || tables->size() > kMaxTables) return false;
    for (const json& table : *tables) {
      if (!readTable(table, part.tables.emplace_back())) return false;
    }
    return readPlace(source, part);
  }

 private:
  static bool readTable(const json& source, HashTable& table) {
    const auto resolution = getUnsigned(source, "resolution", kMaxTableResolution);
    const auto entries = getUnsigned(source, "entries", kMaxTableEntries);
    const auto hashed = getBoolean(source, "hashed");
    const json* ranges = getArray(source, "ranges");
    if (!resolution || !entries || *entries < 1 || !hashed || !ranges || ranges->size() != table.ranges.size())
      return false;
    for (size_t f = 0; f < table.ranges.size(); ++f) {
      if (!takeRange((*ranges)[f], table.ranges[f])) return false;
    }
    table.resolution = *resolution;
    table.entries = *entries;
    table.hashed = *hashed;
    return true;
  }

 public:
  bool readPictures(const json& source, PartHeader& header, const char*& what) {
    HashPart& part = header.part;
    what = "macroblocks";
    const auto takeCorners = [&](const json& pictures, const PictureSize& size) {
      return readCorners(pictures, size, header.stored, part);
    };
    if (!readMacroblocks(source, part.lattice, header.stored, part, takeCorners)) return false;
    what = "tables";
    for (size_t l = 0; l < part.tables.size(); ++l) {
      HashTable& table = part.tables[l];
      table.bytes.resize(size_t{table.entries} * HashPart::kFeatures);
      const json* pictures = getField((*getArray(source, "tables"))[l], "texels");
      const auto take = [&](const ImageU8& picture, size_t which) { return takeTexels(picture, which, table.bytes); };
      if (!pictures || !takePictures(*pictures, sizeOfList(table.entries), take)) return false;
    }
    what = "occupied cells";
    OccupancyBits occupied(header.cells);
    if (!readBits(source, "occupied", occupied)) return false;
    part.occupied = pyramidFromOccupancy(std::move(occupied));
    if (countNearCells(part.occupied) != header.nearCells) return false;
    part.distances = octantDistances(part.occupied);
    return true;
  }

 private:
  bool readCorners(const json& pictures, const PictureSize& size, uint32_t stored, HashPart& part) {
    const size_t eights = part.columns / HashPart::kFeatures, corners = size_t{stored} * HashPart::kStoredTexels;
    if (!pictures.is_array() || pictures.size() != eights * kTexelPictures) return false;
    part.cornerBytes.resize(corners * part.columns);
    std::vector<uint8_t> eight(corners * HashPart::kFeatures);
    for (size_t e = 0; e < eights; ++e) {
      const auto first = pictures.begin() + static_cast<ptrdiff_t>(e * kTexelPictures);
      const json three(std::vector<json>(first, first + static_cast<ptrdiff_t>(kTexelPictures)));
      const auto take = [&](const ImageU8& picture, size_t which) {
        return takeMacroblocks(picture, which, stored, eight);
      };
      if (!takePictures(three, size, take)) return false;
      for (size_t i = 0; i < corners; ++i) {
        std::copy_n(eight.data() + i * HashPart::kFeatures, HashPart::kFeatures,
                    part.cornerBytes.data() + i * part.columns + e * HashPart::kFeatures);
      }
    }
    return true;
  }
};

}  // namespace

std::optional<HashContent> decodeHash(std::span<const std::byte> file, std::string& reason,
                                      const ContentLimits& limits) {
  reason.clear();
  const auto content = decodeContentFile(file, kHashName, reason);
  if (!content) return std::nullopt;
  return HashReader(*content, reason, limits).read();
}

std::optional<uint64_t> decodedHashBytes(std::string_view text, std::string& reason, const ContentLimits& limits) {
  reason.clear();
  const auto header = decodeContentHeader(text, kHashName, reason);
  if (!header) return std::nullopt;
  return HashReader(*header, reason, limits).readBytes();
}

namespace {

class HashCodec final : public ContentCodec {
 public:
  std::string_view representation() const override { return kHashName; }
  std::optional<uint64_t> memoryBytes(std::string_view json, std::string& reason,
                                      const ContentLimits& limits) const override {
    return decodedHashBytes(json, reason, limits);
  }
  std::unique_ptr<Content> decode(std::span<const std::byte> glb, const Resources&, std::string& reason,
                                  const ContentLimits& limits) const override {
    auto content = decodeHash(glb, reason, limits);
    return content ? makeContent(std::move(*content)) : nullptr;
  }
};

}  // namespace

const ContentCodec& hashCodec() {
  static const HashCodec codec;
  return codec;
}

}  // namespace tessera

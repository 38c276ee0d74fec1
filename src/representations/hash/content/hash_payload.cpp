#include "representations/hash/content/hash_payload.h"

#include "base/check.h"
#include "raymarch/content/content_writer.h"
#include "representations/hash/content/occupancy_distance.h"
#include "tiles/network_payload.h"

namespace tessera {
namespace {

constexpr const char* kRemedy =
    "train with a lower --set lattice, fine_levels or fine_log2_size, or bake with fewer --cells";

class HashWriter : ContentWriter {
 public:
  HashWriter(const HashContent& content, int effort) : ContentWriter(effort), content_(content) {}

  Bytes write() {
    Json ours = {{"weights", levelWeightsName(content_.weights)},
                 {"step", content_.step},
                 {"learned_background", content_.hasLearnedBackground},
                 {"network", writeNetwork(file_, content_.network)},
                 {"parts", Json::array()}};
    if (!content_.logits.empty()) ours["logits"] = content_.logits;
    for (const HashPart& part : content_.parts) ours["parts"].push_back(partToJson(part));
    return file_.finish(kHashName, ours);
  }

 private:
  Json partToJson(const HashPart& part) {
    Json json = place(part);
    json["lattice"] = part.lattice;
    json["ranges"] = ranges(part.ranges);
    const uint32_t stored = part.storedMacroblocks();
    json["macroblocks"] = macroblocks(part, part.lattice, stored);
    if (stored > 0) {
      const auto corners = inOrder(part, part.cornerBytes, size_t{HashPart::kStoredTexels} * part.columns);
      json["macroblocks"]["texels"] = eights(corners, part.columns, stored);
    }
    json["tables"] = Json::array();
    for (const HashTable& table : part.tables) json["tables"].push_back(tableToJson(table));
    json["cells"] = part.cells();
    if (part.distances.ratio > 1) json["nearCells"] = part.distances.nearCells();
    json["occupied"] = picture(pictureOfBits(part.occupied.levels.front()));
    return json;
  }

  // Writes three images for each group of eight columns.
  Json eights(const std::vector<uint8_t>& corners, uint32_t columns, uint32_t stored) {
    Json json = Json::array();
    for (uint32_t first = 0; first < columns; first += HashPart::kFeatures) {
      std::vector<uint8_t> eight;
      eight.reserve(corners.size() / columns * HashPart::kFeatures);
      for (size_t i = first; i < corners.size(); i += columns) {
        eight.insert(eight.end(), corners.begin() + static_cast<ptrdiff_t>(i),
                     corners.begin() + static_cast<ptrdiff_t>(i + HashPart::kFeatures));
      }
      for (Json& one : pictures(picturesOfMacroblocks(eight, stored))) json.push_back(std::move(one));
    }
    return json;
  }

  Json tableToJson(const HashTable& table) {
    return {{"resolution", table.resolution},
            {"entries", table.entries},
            {"hashed", table.hashed},
            {"ranges", ranges(table.ranges)},
            {"texels", pictures(picturesOfTexels(table.bytes, sizeOfList(table.entries)))}};
  }

  template <class Ranges>
  static Json ranges(const Ranges& all) {
    Json json = Json::array();
    for (const ByteRange& range : all) json.push_back({range.low, range.high});
    return json;
  }

  const HashContent& content_;
};

}  // namespace

Bytes encodeHash(const HashContent& content, int effort) {
  const ContentLimits limits;
  requireContentWithin(limits, content.parts.size(), bytesInMemory(content), kRemedy);
  // Any other violated rule is a bug in this program.
  const auto broken = validationError(content);
  CHECK(broken.value_or("") == "");
  for (const HashPart& part : content.parts) {
    CHECK(part.distances == octantDistances(part.occupied));
  }
  Bytes file = HashWriter(content, effort).write();
  requireFileWithin(limits, file.size(), kRemedy);
  return file;
}

}  // namespace tessera

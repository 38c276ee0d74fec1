#include "tiles/volume_payload.h"

#include <fmt/format.h>

#include <bit>
#include <cstring>

#include "base/check.h"
#include "base/error.h"
#include "tiles/content_file.h"
#include "tiles/lossless_image.h"
#include "tiles/volume_pictures.h"

namespace tessera {
namespace {

using Json = nlohmann::ordered_json;

void append(Bytes& bytes, const std::vector<float>& numbers) {
  static_assert(std::endian::native == std::endian::little);
  const auto raw = std::as_bytes(std::span(numbers));
  bytes.insert(bytes.end(), raw.begin(), raw.end());
}

class VolumeWriter {
 public:
  VolumeWriter(const VolumeContent& content, int effort) : content_(content), effort_(effort) {}

  Bytes write() {
    Json ours = {{"featureRange", content_.featureRange},
                 {"densityRange", content_.densityRange},
                 {"network", network()},
                 {"parts", Json::array()}};
    if (content_.stepsPerTexel != 1) ours["stepsPerTexel"] = content_.stepsPerTexel;
    for (const VolumePart& part : content_.parts) ours["parts"].push_back(partOf(part));
    return file_.finish(Representation::volume, ours);
  }

 private:
  Json network() {
    Bytes bytes;
    Json layers = Json::array();
    for (const DenseLayer& layer : content_.network) {
      layers.push_back({layer.inputs, layer.outputs});
      append(bytes, layer.weights);
      append(bytes, layer.biases);
    }
    Json json = {{"layers", std::move(layers)}};
    json.update(file_.add(bytes, kRawBytes));
    return json;
  }

  Json partOf(const VolumePart& part) {
    Json json = {{"centre", part.centre},     {"scale", part.scale},  {"contracted", part.contracted},
                 {"surround", part.surround}, {"low", part.low},      {"high", part.high},
                 {"voxels", part.voxels},     {"planes", part.planes}};
    json["macroblocks"] = macroblocks(part);
    for (const std::vector<uint8_t>& plane : part.planeBytes) {
      json["planeTexels"].push_back(pictures(picturesOfPlane(plane, part.planes)));
    }
    const uint32_t cells = part.planes / VolumePart::kDistanceCell;
    json["occupied"] = picture(pictureOfBits(occupancyFromDistances(part.distances, cells)));
    return json;
  }

  // Their places say their numbers, so that none can be wrong: stored in the order of places.
  Json macroblocks(const VolumePart& part) {
    OccupancyBits alive(part.voxels / VolumePart::kMacroblock);
    std::vector<uint8_t> inOrder;
    inOrder.reserve(part.voxelBytes.size());
    for (size_t place = 0; place < part.macroblocks.size(); ++place) {
      if (part.macroblocks[place] == VolumePart::kEmpty) continue;
      alive.set(place);
      const uint8_t* block = part.voxelBytes.data() + size_t{part.macroblocks[place]} * VolumePart::kMacroblockBytes;
      inOrder.insert(inOrder.end(), block, block + VolumePart::kMacroblockBytes);
    }
    const uint32_t stored = part.storedMacroblocks();
    Json json = {{"stored", stored}, {"alive", picture(pictureOfBits(alive))}};
    if (stored > 0) json["texels"] = pictures(picturesOfMacroblocks(inOrder, stored));
    return json;
  }

  Json pictures(const TexelPictures& three) {
    Json json = Json::array();
    for (const ImageU8& one : three) json.push_back(picture(one));
    return json;
  }

  Json picture(const ImageU8& image) { return file_.add(encodeLossless(image, effort_), kWebP); }

  const VolumeContent& content_;
  int effort_;
  ContentFileWriter file_;
};

Error tooLarge(const std::string& why) {
  return {"a content that was to be written", "", why,
          "train with lower --set voxels and planes, or with level_share=0"};
}

// What settings can cause. All else that would break a rule is a mistake of ours.
void requireWritable(const VolumeContent& content) {
  const VolumeLimits limits;
  if (content.parts.size() > limits.parts) {
    throw tooLarge(fmt::format("merges {} blocks, and readers take {} at most", content.parts.size(), limits.parts));
  }
  uint64_t bytes = 0;
  for (const VolumePart& part : content.parts) bytes += texelBytes(part, part.storedMacroblocks());
  if (bytes > limits.bytes) {
    throw tooLarge(fmt::format("takes {} bytes of memory, and readers take {} at most", bytes, limits.bytes));
  }
}

}  // namespace

Bytes encodeVolume(const VolumeContent& content, int effort) {
  requireWritable(content);
  const auto broken = brokenRule(content);
  CHECK(broken.value_or("") == "");
  for (const VolumePart& part : content.parts) {
    const uint32_t cells = part.planes / VolumePart::kDistanceCell;
    CHECK((part.distances == chebyshevDistances(occupancyFromDistances(part.distances, cells))));
  }
  Bytes file = VolumeWriter(content, effort).write();
  if (const VolumeLimits limits; file.size() > limits.fileBytes) {
    throw tooLarge(fmt::format("takes {} bytes on disk, and readers take {} at most", file.size(), limits.fileBytes));
  }
  return file;
}

}  // namespace tessera

#include "representations/volume/content/volume_payload.h"

#include "base/check.h"
#include "raymarch/content/content_writer.h"
#include "tiles/network_payload.h"

namespace tessera {
namespace {

constexpr const char* kRemedy = "train with lower --set voxels and planes, or with lod_step_fraction=0";

class VolumeWriter : ContentWriter {
 public:
  VolumeWriter(const VolumeContent& content, int effort) : ContentWriter(effort), content_(content) {}

  Bytes write() {
    Json ours = {{"featureRange", content_.featureRange},
                 {"densityRange", content_.densityRange},
                 {"network", writeNetwork(file_, content_.network)},
                 {"parts", Json::array()}};
    if (content_.stepsPerTexel != 1) ours["stepsPerTexel"] = content_.stepsPerTexel;
    for (const VolumePart& part : content_.parts) ours["parts"].push_back(partToJson(part));
    return file_.finish(kVolumeName, ours);
  }

 private:
  Json partToJson(const VolumePart& part) {
    Json json = place(part);
    json["voxels"] = part.voxels;
    json["planes"] = part.planes;
    const uint32_t stored = part.storedMacroblocks();
    json["macroblocks"] = macroblocks(part, part.voxels, stored);
    if (stored > 0) {
      json["macroblocks"]["texels"] =
          pictures(picturesOfMacroblocks(inOrder(part, part.voxelBytes, VolumePart::kMacroblockBytes), stored));
    }
    for (const std::vector<uint8_t>& plane : part.planeBytes) {
      json["planeTexels"].push_back(pictures(picturesOfTexels(plane, {part.planes, part.planes})));
    }
    const uint32_t cells = part.planes / VolumePart::kDistanceCell;
    json["occupied"] = picture(pictureOfBits(occupancyFromDistances(part.distances, cells)));
    return json;
  }

  const VolumeContent& content_;
};

}  // namespace

Bytes encodeVolume(const VolumeContent& content, int effort) {
  const ContentLimits limits;
  uint64_t bytes = sizeof(VolumeContent) + bytesInMemory(content.network);  // as readers count them
  for (const VolumePart& part : content.parts) bytes += sizeof(VolumePart) + texelBytes(part, part.storedMacroblocks());
  requireContentWithin(limits, content.parts.size(), bytes, kRemedy);
  // Any other broken rule is a bug of this program.
  const auto broken = validationError(content);
  CHECK(broken.value_or("") == "");
  for (const VolumePart& part : content.parts) {
    const uint32_t cells = part.planes / VolumePart::kDistanceCell;
    CHECK((part.distances == chebyshevDistances(occupancyFromDistances(part.distances, cells))));
  }
  Bytes file = VolumeWriter(content, effort).write();
  requireFileWithin(limits, file.size(), kRemedy);
  return file;
}

}  // namespace tessera

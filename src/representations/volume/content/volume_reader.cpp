// Decodes volume contents from untrusted bytes.
#include "raymarch/content/content_reader.h"
#include "representations/volume/content/volume_payload.h"
#include "tiles/json_fields.h"

namespace tessera {
namespace {

using namespace json_fields;

// What a part declares of itself, read before anything is allocated for it.
struct PartHeader {
  VolumePart part;  // without texels
  uint32_t stored = 0;

  uint32_t cells() const { return part.planes / VolumePart::kDistanceCell; }
  uint64_t bytes() const { return sizeof(VolumePart) + texelBytes(part, stored); }
};

class VolumeReader : public PartsReader<VolumeReader, VolumeContent, PartHeader> {
 public:
  using PartsReader::PartsReader;

  bool readSettings() {
    const auto features = getNumber(file_.ours, "featureRange"), density = getNumber(file_.ours, "densityRange");
    if (!features || !density) return fail("has no ranges to dequantise with");
    content_.featureRange = static_cast<float>(*features);
    content_.densityRange = static_cast<float>(*density);
    if (const json* steps = getField(file_.ours, "stepsPerTexel")) {
      const auto number = unsignedFrom(*steps, VolumeContent::kMaxStepsPerTexel);
      if (!number) return fail("its steps per texel are out of bounds");
      content_.stepsPerTexel = static_cast<uint32_t>(*number);
    }
    return true;
  }

  static bool readHeader(const json& source, PartHeader& header) {
    VolumePart& part = header.part;
    const auto voxels = getUnsigned(source, "voxels", kMaxVoxels), planes = getUnsigned(source, "planes", kMaxPlanes);
    const auto stored = readStoredCount(source);
    if (!voxels || !planes || !stored) return false;
    if (*voxels < 1 || *voxels % VolumePart::kMacroblock != 0) return false;
    if (*planes < 1 || *planes % VolumePart::kDistanceCell != 0) return false;
    part.voxels = *voxels;
    part.planes = *planes;
    header.stored = *stored;
    return readPlace(source, part);
  }

  bool readPictures(const json& source, PartHeader& header, const char*& what) {
    VolumePart& part = header.part;
    what = "macroblocks";
    const auto takeVoxels = [&](const json& pictures, const PictureSize& size) {
      part.voxelBytes.resize(size_t{header.stored} * VolumePart::kMacroblockBytes);
      return takePictures(pictures, size, [&](const ImageU8& picture, size_t which) {
        return takeMacroblocks(picture, which, header.stored, part.voxelBytes);
      });
    };
    if (!readMacroblocks(source, part.voxels, header.stored, part, takeVoxels)) return false;
    what = "planes";
    const json* planes = getArray(source, "planeTexels");
    if (!planes || planes->size() != 3) return false;
    for (size_t axis = 0; axis < 3; ++axis) {
      part.planeBytes[axis].resize(size_t{part.planes} * part.planes * VolumePart::kAttributes);
      const auto take = [&](const ImageU8& picture, size_t which) {
        return takeTexels(picture, which, part.planeBytes[axis]);
      };
      if (!takePictures((*planes)[axis], {part.planes, part.planes}, take)) return false;
    }
    what = "occupied cells";
    OccupancyBits occupied(header.cells());
    if (!readBits(source, "occupied", occupied)) return false;
    part.distances = chebyshevDistances(occupied);
    return true;
  }
};

}  // namespace

std::optional<VolumeContent> decodeVolume(std::span<const std::byte> file, std::string& reason,
                                          const ContentLimits& limits) {
  reason.clear();
  const auto content = decodeContentFile(file, kVolumeName, reason);
  if (!content) return std::nullopt;
  return VolumeReader(*content, reason, limits).read();
}

std::optional<uint64_t> decodedVolumeBytes(std::string_view text, std::string& reason, const ContentLimits& limits) {
  reason.clear();
  const auto header = decodeContentHeader(text, kVolumeName, reason);
  if (!header) return std::nullopt;
  return VolumeReader(*header, reason, limits).readBytes();
}

namespace {

class VolumeCodec final : public ContentCodec {
 public:
  std::string_view representation() const override { return kVolumeName; }
  std::optional<uint64_t> memoryBytes(std::string_view json, std::string& reason,
                                      const ContentLimits& limits) const override {
    return decodedVolumeBytes(json, reason, limits);
  }
  std::unique_ptr<Content> decode(std::span<const std::byte> glb, const Resources&, std::string& reason,
                                  const ContentLimits& limits) const override {
    auto content = decodeVolume(glb, reason, limits);
    return content ? makeContent(std::move(*content)) : nullptr;
  }
};

}  // namespace

const ContentCodec& volumeCodec() {
  static const VolumeCodec codec;
  return codec;
}

}  // namespace tessera

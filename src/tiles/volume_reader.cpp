// A volume's content, read: untrusted bytes.
#include <fmt/format.h>

#include "tiles/content_reader.h"
#include "tiles/json_fields.h"
#include "tiles/volume_payload.h"

namespace tessera {
namespace {

using namespace json_fields;

// What a part says of itself, before anything is allocated for it.
struct PartHeader {
  VolumePart part;  // without texels
  uint32_t stored = 0;
  const json* source = nullptr;

  uint32_t cells() const { return part.planes / VolumePart::kDistanceCell; }
  uint64_t bytes() const { return texelBytes(part, stored); }
};

class VolumeReader : ContentReader {
 public:
  VolumeReader(const ContentFile& file, std::string& reason, const ContentLimits& limits)
      : ContentReader(file, reason, limits) {}

  std::optional<VolumeContent> read() {
    if (!readRanges() || !readLayers(content_.network) || !readNetwork(content_.network) || !readHeaders()) {
      return std::nullopt;
    }
    for (size_t i = 0; i < headers_.size(); ++i) {
      if (!readTexels(headers_[i])) {
        fail(fmt::format("part {}: its {} are not what they should be", i, what_));
        return std::nullopt;
      }
      content_.parts.push_back(std::move(headers_[i].part));
    }
    if (auto broken = brokenRule(content_)) {
      fail(*broken);
      return std::nullopt;
    }
    return std::move(content_);
  }

  // Looks at no buffer view.
  std::optional<uint64_t> readBytes() {
    if (!readRanges() || !readLayers(content_.network) || !readHeaders()) return std::nullopt;
    uint64_t bytes = bytesInMemory(content_);
    for (const DenseLayer& layer : content_.network) {
      bytes += sizeof(float) * (uint64_t{layer.inputs} * layer.outputs + layer.outputs);
    }
    for (const PartHeader& header : headers_) bytes += sizeof(VolumePart) + header.bytes();
    return bytes;
  }

 private:
  bool readRanges() {
    const auto features = numberOf(file_.ours, "featureRange"), density = numberOf(file_.ours, "densityRange");
    if (!features || !density) return fail("has no ranges to dequantise with");
    content_.featureRange = static_cast<float>(*features);
    content_.densityRange = static_cast<float>(*density);
    if (const json* steps = fieldOf(file_.ours, "stepsPerTexel")) {
      const auto number = unsignedFrom(*steps, VolumeContent::kMostStepsPerTexel);
      if (!number) return fail("its steps per texel are out of bounds");
      content_.stepsPerTexel = static_cast<uint32_t>(*number);
    }
    return true;
  }

  bool readHeaders() {
    const json* parts = partsOf();
    if (!parts) return false;
    uint64_t bytes = 0;
    for (const json& source : *parts) {
      PartHeader header;
      header.source = &source;
      if (!readHeader(source, header)) return fail(fmt::format("part {}: its header is not complete", headers_.size()));
      bytes += header.bytes();
      if (bytes > limits_.bytes) return fail(fmt::format("takes more than {} bytes of memory", limits_.bytes));
      headers_.push_back(std::move(header));
    }
    return true;
  }

  static bool readHeader(const json& source, PartHeader& header) {
    VolumePart& part = header.part;
    const auto voxels = unsignedOf(source, "voxels", kMostVoxels), planes = unsignedOf(source, "planes", kMostPlanes);
    const auto stored = storedOf(source);
    if (!voxels || !planes || !stored) return false;
    if (*voxels < 1 || *voxels % VolumePart::kMacroblock != 0) return false;
    if (*planes < 1 || *planes % VolumePart::kDistanceCell != 0) return false;
    part.voxels = *voxels;
    part.planes = *planes;
    header.stored = *stored;
    return readPlace(source, part);
  }

  bool readTexels(PartHeader& header) {
    VolumePart& part = header.part;
    const json& source = *header.source;
    what_ = "macroblocks";
    const auto takeVoxels = [&](const json& pictures, const PictureSize& size) {
      part.voxelBytes.resize(size_t{header.stored} * VolumePart::kMacroblockBytes);
      return readPictures(pictures, size, [&](const ImageU8& picture, size_t which) {
        return takeMacroblocks(picture, which, header.stored, part.voxelBytes);
      });
    };
    if (!readMacroblocks(source, part.voxels, header.stored, part, takeVoxels)) return false;
    what_ = "planes";
    const json* planes = arrayOf(source, "planeTexels");
    if (!planes || planes->size() != 3) return false;
    for (size_t axis = 0; axis < 3; ++axis) {
      part.planeBytes[axis].resize(size_t{part.planes} * part.planes * VolumePart::kAttributes);
      const auto take = [&](const ImageU8& picture, size_t which) {
        return takeTexels(picture, which, part.planeBytes[axis]);
      };
      if (!readPictures((*planes)[axis], {part.planes, part.planes}, take)) return false;
    }
    what_ = "occupied cells";
    OccupancyBits occupied(header.cells());
    if (!readBits(source, "occupied", occupied)) return false;
    part.distances = chebyshevDistances(occupied);
    return true;
  }

  const char* what_ = "";  // is being read
  std::vector<PartHeader> headers_;
  VolumeContent content_;
};

}  // namespace

std::optional<VolumeContent> decodeVolume(std::span<const std::byte> file, std::string& reason,
                                          const ContentLimits& limits) {
  reason.clear();
  const auto content = decodeContentFile(file, Representation::volume, reason);
  if (!content) return std::nullopt;
  return VolumeReader(*content, reason, limits).read();
}

std::optional<uint64_t> decodedVolumeBytes(std::string_view text, std::string& reason, const ContentLimits& limits) {
  reason.clear();
  const auto header = decodeContentHeader(text, Representation::volume, reason);
  if (!header) return std::nullopt;
  return VolumeReader(*header, reason, limits).readBytes();
}

}  // namespace tessera

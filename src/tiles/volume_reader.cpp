// A volume's content, read: untrusted bytes.
#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cstring>

#include "base/error.h"
#include "tiles/content_file.h"
#include "tiles/glb.h"
#include "tiles/json_fields.h"
#include "tiles/lossless_image.h"
#include "tiles/volume_payload.h"
#include "tiles/volume_pictures.h"

namespace tessera {
namespace {

using namespace json_fields;

bool takeFloats(std::span<const std::byte>& bytes, size_t count, std::vector<float>& numbers) {
  static_assert(std::endian::native == std::endian::little);
  if (bytes.size() / sizeof(float) < count) return false;
  numbers.resize(count);
  std::memcpy(numbers.data(), bytes.data(), count * sizeof(float));
  bytes = bytes.subspan(count * sizeof(float));
  return true;
}

bool takeTriple(const json& object, const char* key, std::array<float, 3>& triple) {
  const auto numbers = numbersOf<3>(object, key);
  if (!numbers) return false;
  for (size_t a = 0; a < 3; ++a) triple[a] = static_cast<float>((*numbers)[a]);
  return true;
}

// What a part says of itself, before anything is allocated for it.
struct PartHeader {
  VolumePart part;  // without texels
  uint32_t stored = 0;
  const json* source = nullptr;

  uint32_t macroblockEdge() const { return part.voxels / VolumePart::kMacroblock; }
  uint32_t cells() const { return part.planes / VolumePart::kDistanceCell; }
  uint64_t bytes() const { return texelBytes(part, stored); }
};

class VolumeReader {
 public:
  VolumeReader(const ContentFile& file, std::string& reason, const VolumeLimits& limits)
      : file_(file), reason_(reason), limits_(limits) {}

  std::optional<VolumeContent> read() {
    if (!readRanges() || !readLayers() || !readNetwork() || !readHeaders()) return std::nullopt;
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
    if (!readRanges() || !readLayers() || !readHeaders()) return std::nullopt;
    uint64_t bytes = bytesInMemory(content_);
    for (const DenseLayer& layer : content_.network) {
      bytes += sizeof(float) * (uint64_t{layer.inputs} * layer.outputs + layer.outputs);
    }
    for (const PartHeader& header : headers_) bytes += sizeof(VolumePart) + header.bytes();
    return bytes;
  }

 private:
  bool fail(const std::string& reason) {
    if (reason_.empty()) reason_ = reason;
    return false;
  }

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

  // What the layers are to hold.
  bool readLayers() {
    const json* network = fieldOf(file_.ours, "network");
    const json* layers = network ? arrayOf(*network, "layers") : nullptr;
    if (!layers || layers->size() > kMostLayers) return fail("has no network");
    for (const json& sides : *layers) {
      if (!sides.is_array() || sides.size() != 2) return fail("a layer of the network has no two sides");
      const auto inputs = unsignedFrom(sides[0], kMostLayerWidth), outputs = unsignedFrom(sides[1], kMostLayerWidth);
      if (!inputs || !outputs) return fail("a layer of the network is out of bounds");
      DenseLayer layer;
      layer.inputs = static_cast<uint32_t>(*inputs);
      layer.outputs = static_cast<uint32_t>(*outputs);
      content_.network.push_back(std::move(layer));
    }
    return true;
  }

  bool readNetwork() {
    auto bytes = file_.viewOf(*fieldOf(file_.ours, "network"), kRawBytes);
    if (!bytes) return fail("has no network");
    for (DenseLayer& layer : content_.network) {
      if (!takeFloats(*bytes, size_t{layer.inputs} * layer.outputs, layer.weights) ||
          !takeFloats(*bytes, layer.outputs, layer.biases)) {
        return fail("the network has fewer numbers than its layers need");
      }
    }
    return bytes->empty() || fail("the network has more numbers than its layers need");
  }

  bool readHeaders() {
    const json* parts = arrayOf(file_.ours, "parts");
    if (!parts || parts->empty() || parts->size() > limits_.parts) return fail("has no parts, or too many");
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
    const auto contracted = flagOf(source, "contracted"), surround = flagOf(source, "surround");
    const auto voxels = unsignedOf(source, "voxels", kMostVoxels), planes = unsignedOf(source, "planes", kMostPlanes);
    const json* macroblocks = fieldOf(source, "macroblocks");
    const auto stored = macroblocks ? unsignedOf(*macroblocks, "stored", kMostStored) : std::nullopt;
    if (!contracted || !surround || !voxels || !planes || !stored) return false;
    if (*voxels < 1 || *voxels % VolumePart::kMacroblock != 0) return false;
    if (*planes < 1 || *planes % VolumePart::kDistanceCell != 0) return false;
    part.contracted = *contracted;
    part.surround = *surround;
    part.voxels = *voxels;
    part.planes = *planes;
    header.stored = *stored;
    return takeTriple(source, "centre", part.centre) && takeTriple(source, "scale", part.scale) &&
           takeTriple(source, "low", part.low) && takeTriple(source, "high", part.high);
  }

  bool readTexels(PartHeader& header) {
    VolumePart& part = header.part;
    const json& source = *header.source;
    const json& macroblocks = *fieldOf(source, "macroblocks");
    what_ = "macroblocks";
    if (!readMacroblocks(macroblocks, header)) return false;
    what_ = "planes";
    const json* planes = arrayOf(source, "planeTexels");
    if (!planes || planes->size() != 3) return false;
    for (size_t axis = 0; axis < 3; ++axis) {
      part.planeBytes[axis].resize(size_t{part.planes} * part.planes * VolumePart::kAttributes);
      const auto take = [&](const ImageU8& picture, size_t which) {
        return takePlane(picture, which, part.planeBytes[axis]);
      };
      if (!readPictures((*planes)[axis], {part.planes, part.planes}, take)) return false;
    }
    what_ = "occupied cells";
    OccupancyBits occupied(header.cells());
    if (!readBits(source, "occupied", occupied)) return false;
    part.distances = chebyshevDistances(occupied);
    return true;
  }

  bool readMacroblocks(const json& source, PartHeader& header) {
    VolumePart& part = header.part;
    OccupancyBits alive(header.macroblockEdge());
    if (!readBits(source, "alive", alive)) return false;
    uint32_t count = 0;
    for (const uint64_t word : alive.words) count += static_cast<uint32_t>(std::popcount(word));
    if (count != header.stored) return false;
    part.macroblocks.resize(alive.count());
    uint32_t number = 0;
    for (size_t place = 0; place < alive.count(); ++place) {
      part.macroblocks[place] = alive.at(place) ? number++ : VolumePart::kEmpty;
    }
    if (header.stored == 0) return true;
    part.voxelBytes.resize(size_t{header.stored} * VolumePart::kMacroblockBytes);
    const json* texels = fieldOf(source, "texels");
    return texels && readPictures(*texels, sizeOfMacroblocks(header.stored), [&](const ImageU8& picture, size_t which) {
             return takeMacroblocks(picture, which, header.stored, part.voxelBytes);
           });
  }

  template <class Take>
  bool readPictures(const json& source, const PictureSize& size, const Take& take) {
    if (!source.is_array() || source.size() != kTexelPictures) return false;
    for (size_t which = 0; which < kTexelPictures; ++which) {
      const auto picture = readPicture(source[which], size);
      if (!picture || !take(*picture, which)) return false;
    }
    return true;
  }

  bool readBits(const json& source, const char* key, OccupancyBits& bits) {
    const json* entry = fieldOf(source, key);
    const auto picture = entry ? readPicture(*entry, sizeOfBits(bits.count())) : std::nullopt;
    return picture && takeBits(*picture, bits);
  }

  std::optional<ImageU8> readPicture(const json& source, const PictureSize& size) {
    const auto bytes = file_.viewOf(source, kWebP);
    if (!bytes) return std::nullopt;
    return decodeLossless(*bytes, static_cast<int>(size.width), static_cast<int>(size.height));
  }

  const ContentFile& file_;
  std::string& reason_;
  const VolumeLimits& limits_;
  const char* what_ = "";  // is being read
  std::vector<PartHeader> headers_;
  VolumeContent content_;
};

Error noContent(const fs::path& path, const std::string& reason) {
  return {path.string(), "", reason, "copy the scene again, or bake it again"};
}

}  // namespace

std::optional<VolumeContent> decodeVolume(std::span<const std::byte> file, std::string& reason,
                                          const VolumeLimits& limits) {
  reason.clear();
  const auto content = decodeContentFile(file, Representation::volume, reason);
  if (!content) return std::nullopt;
  return VolumeReader(*content, reason, limits).read();
}

VolumeContent readVolume(const fs::path& path, const VolumeLimits& limits) {
  std::string reason;
  auto content = decodeVolume(readFile(path, limits.fileBytes), reason, limits);
  if (!content) throw noContent(path, reason);
  return std::move(*content);
}

VolumeContent readPromisedVolume(const fs::path& path, size_t tile, const TileContent& promised) {
  VolumeContent content = readVolume(path);
  if (const auto broken = brokenPromise(content, promised)) {
    throw Error(path.string(), fmt::format("of tile {} in tileset.json", tile), *broken,
                "copy the scene again, or bake it again");
  }
  return content;
}

std::optional<uint64_t> decodedBytesOf(std::string_view json, std::string& reason, const VolumeLimits& limits) {
  reason.clear();
  ContentFile file;
  const auto asset = decodeContentAsset(json, Representation::volume, reason);
  if (!asset) return std::nullopt;
  file.ours = contentExtensionOf(*asset);
  return VolumeReader(file, reason, limits).readBytes();
}

uint64_t readDecodedBytes(const fs::path& path, const VolumeLimits& limits) {
  std::error_code status;
  const auto length = jsonLengthOf(readFileStart(path, kGlbStart), fs::file_size(path, status));
  if (!length) throw noContent(path, kNoGlb);
  // A byte more than is allowed is enough to see that it is too much.
  const Bytes start = readFileStart(path, kGlbStart + std::min<uint64_t>(*length, kMostContentJson + 1));
  const std::string_view text(reinterpret_cast<const char*>(start.data()), start.size());
  std::string reason;
  const auto bytes = decodedBytesOf(text.substr(std::min(kGlbStart, text.size())), reason, limits);
  if (!bytes) throw noContent(path, reason);
  return *bytes;
}

}  // namespace tessera

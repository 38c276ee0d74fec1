// Decodes mesh contents from untrusted bytes.
#include <fmt/format.h>

#include <cstring>

#include "base/check.h"
#include "base/image.h"
#include "representations/mesh/content/mesh_encoder.h"
#include "representations/mesh/content/mesh_payload.h"
#include "tiles/content_file.h"
#include "tiles/json_fields.h"
#include "tiles/lossless_image.h"
#include "tiles/network_payload.h"

namespace tessera {
namespace {

using namespace json_fields;

class MeshReader {
 public:
  MeshReader(const ContentFile& file, std::string& reason, const ContentLimits& limits)
      : file_(file), reason_(reason), limits_(limits) {}

  // Returns the content, or nothing after fail().
  std::optional<MeshContent> read(const Resources& resources) {
    for (const auto& resource : resources) {
      content_.encoders.push_back(std::dynamic_pointer_cast<const SharedEncoder>(resource));
      CHECK(content_.encoders.back() != nullptr);
    }
    if (!readHeaders() || !readSky()) return std::nullopt;
    for (size_t i = 0; i < content_.parts.size(); ++i)
      if (!readPart(i)) return std::nullopt;
    if (auto broken = validationError(content_)) {
      fail(*broken);
      return std::nullopt;
    }
    return std::move(content_);
  }

  // Returns the memory in bytes that the content will take. Reads the JSON alone, no buffer view.
  std::optional<uint64_t> readBytes() {
    if (!readHeaders()) return std::nullopt;
    return bytes_;
  }

 private:
  bool fail(const std::string& reason) {
    if (reason_.empty()) reason_ = reason;
    return false;
  }
  bool failPart(size_t part, const char* why) { return fail(fmt::format("part {}: {}", part, why)); }

  const json& source(size_t part) const { return (*getArray(file_.ours, "parts"))[part]; }

  bool readHeaders() {
    const auto isBackground = getBoolean(file_.ours, "background_block");
    if (!isBackground) return fail("background_block is missing or malformed");
    content_.isBackground = *isBackground;
    if (const json* sky = getField(file_.ours, "sky")) {
      const auto edge = getUnsigned(*sky, "edge", kMaxSkyEdge);
      if (!edge || *edge < 2) return fail("the edge of its sky is out of bounds");
      content_.skyEdge = *edge;
    }
    const json* parts = getArray(file_.ours, "parts");
    if (!parts || parts->empty() || parts->size() > limits_.parts)
      return fail("its parts are not a list, or their number is out of bounds");
    bytes_ = bytesInMemory(content_);
    for (size_t i = 0; i < parts->size(); ++i) {
      if (!readHeader(i, content_.parts.emplace_back())) return false;
      if (bytes_ > limits_.bytes) return fail(fmt::format("takes more than {} bytes of memory", limits_.bytes));
    }
    return true;
  }

  bool readHeader(size_t number, PatchSet& part) {
    const json& json = source(number);
    const auto edge = getUnsigned(json, "patch_edge", PatchSet::kMaxPatchEdge);
    if (!edge || *edge < PatchSet::kMinPatchEdge || *edge % 4 != 0)
      return failPart(number, "its patch_edge is out of bounds");
    const auto patches = getUnsigned(json, "patches", maxPatches(*edge)),
               pairs = getUnsigned(json, "pairs", patches.value_or(0));
    if (!patches || !pairs) return failPart(number, "its patches or pairs are out of bounds");
    const auto origin = getNumbers<3>(json, "origin");
    const auto step = getNumber(json, "step");
    if (!origin || !step) return failPart(number, "its origin or step is missing or malformed");
    part.patchEdge = *edge;
    part.patches = *patches;
    part.pairs = *pairs;
    part.origin = *origin;
    part.step = *step;
    const nlohmann::json* ranges = getArray(json, "ranges");
    if (!ranges || ranges->size() != kMeshFeatures) return failPart(number, "its ranges are missing or malformed");
    for (size_t f = 0; f < kMeshFeatures; ++f) {
      const auto ends = numbersFrom<2>((*ranges)[f]);
      if (!ends) return failPart(number, "its ranges are missing or malformed");
      part.ranges[f] = {static_cast<float>((*ends)[0]), static_cast<float>((*ends)[1])};
    }
    if (!readLayers(getField(json, "network"), part.decoder, reason_)) return false;
    if (part.patches == 0) {
      for (const char* const name : {"vertices", "features", "opacity", "encoder"})
        if (getField(json, name)) return fail(fmt::format("part {}: it has {}, but no patches", number, name));
    }
    if (const auto* encoder = getField(json, "encoder")) {
      if (getField(json, "features") || getField(json, "opacity"))
        return failPart(number, "it has both an encoder and stored maps");
      if (!readEncoder(*encoder, part.encoder.emplace())) return failPart(number, "its encoder is malformed");
    }
    bytes_ += patchSetBytes(part);
    return true;
  }

  static bool readEncoder(const json& json, PatchEncoder& encoder) {
    const auto resource = getUnsigned(json, "resource"), places = getUnsigned(json, "places");
    const auto scale = getNumbers<3>(json, "scale"), offset = getNumbers<3>(json, "offset");
    const auto opaque = getNumber(json, "opaque_from"), transparent = getNumber(json, "transparent_below");
    if (!resource || !places || !scale || !offset || !opaque || !transparent) return false;
    encoder = {*resource, *scale, *offset, *places, static_cast<float>(*opaque), static_cast<float>(*transparent)};
    return true;
  }

  bool readSky() {
    if (content_.skyEdge == 0) return true;
    const json* texels = getField(*getField(file_.ours, "sky"), "texels");
    const auto bytes = texels ? file_.bufferViewBytes(*texels, kWebP) : std::nullopt;
    const int edge = static_cast<int>(content_.skyEdge);
    const auto image = bytes ? decodeLossless(*bytes, edge, 6 * edge) : std::nullopt;
    if (!image) return fail("its sky is malformed");
    content_.sky = image->pixels;
    return true;
  }

  bool readPart(size_t number) {
    PatchSet& part = content_.parts[number];
    const json& json = source(number);
    if (!readLayerNumbers(file_, *getField(json, "network"), part.decoder, reason_)) return false;
    if (part.patches == 0) return true;
    part.vertices.resize(size_t{12} * part.patches);
    if (!readBlocks(getField(json, "vertices"), part.vertices.data(), 2 * part.vertices.size()))
      return failPart(number, "its vertices are malformed");
    if (part.encoder) return true;
    const nlohmann::json* features = getArray(json, "features");
    if (!features || features->size() != part.featureBlocks.size())
      return failPart(number, "its features are malformed");
    for (size_t k = 0; k < part.featureBlocks.size(); ++k) {
      part.featureBlocks[k].resize(part.textureBlocks() * PatchSet::kBc5Bytes);
      if (!readBlocks(&(*features)[k], part.featureBlocks[k].data(), part.featureBlocks[k].size()))
        return failPart(number, "its features are malformed");
    }
    part.opacityBlocks.resize(part.textureBlocks() * PatchSet::kBc4Bytes);
    if (!readBlocks(getField(json, "opacity"), part.opacityBlocks.data(), part.opacityBlocks.size()))
      return failPart(number, "its opacity is malformed");
    return true;
  }

  // Copies the view, which must have exactly this many bytes.
  bool readBlocks(const json* reference, void* to, size_t count) const {
    const auto bytes = reference ? file_.bufferViewBytes(*reference, kRawBytes) : std::nullopt;
    if (!bytes || bytes->size() != count) return false;
    std::memcpy(to, bytes->data(), count);
    return true;
  }

  const ContentFile& file_;
  std::string& reason_;
  const ContentLimits& limits_;
  MeshContent content_;
  uint64_t bytes_ = 0;
};

class MeshCodec final : public ContentCodec {
 public:
  std::string_view representation() const override { return kMeshName; }
  bool contentsMayOverlap() const override { return true; }
  std::optional<uint64_t> memoryBytes(std::string_view json, std::string& reason,
                                      const ContentLimits& limits) const override {
    return decodedMeshBytes(json, reason, limits);
  }
  std::unique_ptr<Content> decode(std::span<const std::byte> glb, const Resources& resources, std::string& reason,
                                  const ContentLimits& limits) const override {
    auto content = decodeMesh(glb, reason, limits, resources);
    return content ? makeContent(std::move(*content)) : nullptr;
  }
  uint64_t resourceMemoryBytes(const SharedResource&, uint64_t fileBytes) const override {
    return sizeof(SharedEncoder) + fileBytes;
  }
  std::shared_ptr<const Resource> decodeResource(std::span<const std::byte> file, const SharedResource&,
                                                 std::string& reason, const ContentLimits& limits) const override {
    auto encoder = decodeMeshEncoder(file, reason, limits);
    return encoder ? std::make_shared<SharedEncoder>(std::move(*encoder)) : nullptr;
  }
};

}  // namespace

std::optional<MeshContent> decodeMesh(std::span<const std::byte> file, std::string& reason, const ContentLimits& limits,
                                      const Resources& resources) {
  reason.clear();
  const auto content = decodeContentFile(file, kMeshName, reason);
  if (!content) return std::nullopt;
  return MeshReader(*content, reason, limits).read(resources);
}

std::optional<uint64_t> decodedMeshBytes(std::string_view text, std::string& reason, const ContentLimits& limits) {
  reason.clear();
  const auto header = decodeContentHeader(text, kMeshName, reason);
  if (!header) return std::nullopt;
  return MeshReader(*header, reason, limits).readBytes();
}

const ContentCodec& meshCodec() {
  static const MeshCodec codec;
  return codec;
}

}  // namespace tessera

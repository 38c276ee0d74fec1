#include "tiles/content_file.h"

#include <fmt/format.h>

#include <algorithm>

#include "base/check.h"
#include "tiles/glb.h"
#include "tiles/json_fields.h"

namespace tessera {
namespace {

using namespace json_fields;
using Json = nlohmann::ordered_json;

constexpr const char* kContentExtension = "TESSERA_content";
constexpr size_t kMaxViews = size_t{1} << 16;

bool uses(const json& asset, const char* extension) {
  const json* used = getArray(asset, "extensionsUsed");
  return used && std::find(used->begin(), used->end(), extension) != used->end();
}

// Returns the only buffer: the file's binary chunk, which may be padded by up to three bytes.
std::optional<std::span<const std::byte>> findBuffer(const json& asset, std::span<const std::byte> bytes) {
  const json* buffers = getArray(asset, "buffers");
  if (!buffers || buffers->size() != 1 || getField((*buffers)[0], "uri")) return std::nullopt;
  const auto length = getUnsigned((*buffers)[0], "byteLength");
  if (!length || *length > bytes.size() || bytes.size() - *length > 3) return std::nullopt;
  return bytes.first(*length);
}

bool readViews(const json& asset, std::span<const std::byte> bytes, ContentFile& file) {
  const auto buffer = findBuffer(asset, bytes);
  const json* views = getArray(asset, "bufferViews");
  if (!buffer || !views || views->size() > kMaxViews) return false;
  for (const json& view : *views) {
    const auto length = getUnsigned(view, "byteLength");
    const auto offset = getField(view, "byteOffset") ? getUnsigned(view, "byteOffset") : std::optional<uint32_t>(0);
    if (getUnsigned(view, "buffer") != 0u || !length || !offset) return false;
    if (*offset > buffer->size() || *length > buffer->size() - *offset) return false;
    file.views.push_back(buffer->subspan(*offset, *length));
  }
  return true;
}

std::optional<json> decodeAsset(std::string_view text, std::string_view representation, std::string& reason) {
  const auto fail = [&reason](std::string why) {
    reason = std::move(why);
    return std::nullopt;
  };
  if (text.size() > kMaxContentJson) return fail("its JSON is larger than any content's should be");
  json asset = json::parse(text, nullptr, false);
  const json* header = getField(asset, "asset");
  if (!header || !isString(*header, "version", "2.0")) return fail("its JSON is not that of a glTF 2.0 asset");
  const json* extensions = getField(asset, "extensions");
  const json* ours = extensions ? getField(*extensions, kContentExtension) : nullptr;
  if (!ours || !uses(asset, kContentExtension)) return fail("has no extension TESSERA_content");
  const auto version = getUnsigned(*ours, "version");
  if (!version) return fail("does not state its version");
  if (*version != kContentVersion)
    return fail(fmt::format("has version {}; only {} is supported", *version, kContentVersion));
  if (!isString(*ours, "representation", representation)) {
    return fail(fmt::format("is not of the representation {}", representation));
  }
  return asset;
}

}  // namespace

size_t ContentFileWriter::addView(std::span<const std::byte> bytes, uint32_t target) {
  CHECK(!bytes.empty());
  const size_t view = views_.size();
  add(bytes, kRawBytes);
  if (target != 0) views_.back()["target"] = target;
  return view;
}

Json ContentFileWriter::add(std::span<const std::byte> bytes, const char* mimeType) {
  bytes_.resize((bytes_.size() + 3) / 4 * 4);
  views_.push_back({{"buffer", 0}, {"byteOffset", bytes_.size()}, {"byteLength", bytes.size()}});
  bytes_.insert(bytes_.end(), bytes.begin(), bytes.end());
  return {{"bufferView", views_.size() - 1}, {"mimeType", mimeType}};
}

Bytes ContentFileWriter::finish(std::string_view representation, const Json& ours, const GltfScene& scene) {
  CHECK(!views_.empty());
  CHECK(scene.isEmpty() == scene.roots.empty());
  Json extension = {{"version", kContentVersion}, {"representation", representation}};
  extension.update(ours);
  Json asset = {{"asset", {{"version", "2.0"}, {"generator", "tessera"}}},
                {"extensionsUsed", {kContentExtension}},
                {"scene", 0},
                {"scenes", {Json::object()}},
                {"buffers", {{{"byteLength", bytes_.size()}}}},
                {"bufferViews", views_},
                {"extensions", {{kContentExtension, std::move(extension)}}}};
  if (!scene.isEmpty()) scene.addTo(asset);
  return encodeGlb(asset.dump(), bytes_);
}

std::optional<std::span<const std::byte>> ContentFile::bufferViewBytes(const json& object, const char* mimeType) const {
  const auto index = getUnsigned(object, "bufferView");
  if (!index || *index >= views.size() || !isString(object, "mimeType", mimeType)) return std::nullopt;
  return views[*index];
}

std::optional<ContentFile> decodeContentHeader(std::string_view text, std::string_view representation,
                                               std::string& reason) {
  const auto asset = decodeAsset(text, representation, reason);
  if (!asset) return std::nullopt;
  ContentFile result;
  result.ours = asset->at("extensions").at(kContentExtension);
  return result;
}

std::optional<ContentFile> decodeContentFile(std::span<const std::byte> file, std::string_view representation,
                                             std::string& reason) {
  const auto glb = decodeGlb(file);
  if (!glb) {
    reason = kNoGlb;
    return std::nullopt;
  }
  const auto asset = decodeAsset(glb->json, representation, reason);
  if (!asset) return std::nullopt;
  ContentFile result;
  if (!readViews(*asset, glb->bytes, result)) {
    reason = "its buffer views do not lie within its bytes";
    return std::nullopt;
  }
  result.ours = asset->at("extensions").at(kContentExtension);
  return result;
}

}  // namespace tessera

// The container that contents of all representations share: a .glb that is a valid glTF 2.0 asset (with an empty scene
// if other programs cannot draw anything of it), whose extension TESSERA_content describes a payload in buffer views.
// See docs/tile-format.md, section 5. This header exposes JSON; it is for codecs, not for their users.
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/file.h"
#include "tiles/gltf_scene.h"
#include "tiles/tileset.h"

namespace tessera {

inline constexpr int kContentVersion = 1;
inline constexpr size_t kMaxContentJson = size_t{8} << 20;  // bytes
inline constexpr const char* kNoGlb = "is not a binary glTF 2.0 file, or is cut short";
inline constexpr const char* kWebP = "image/webp";
inline constexpr const char* kRawBytes = "application/octet-stream";

class ContentFileWriter {
 public:
  // Adds a buffer view for accessors or images and returns its index. `target`: glTF's constant for vertices (34962) or
  // indices (34963); 0 for images.
  size_t addView(std::span<const std::byte> bytes, uint32_t target = 0);
  // Adds a buffer view for the payload and returns {"bufferView": n, "mimeType": ...}, the form in which the extension
  // refers to it.
  nlohmann::ordered_json add(std::span<const std::byte> bytes, const char* mimeType);
  // `ours`: the extension's members after version and representation. CHECKs that at least one view was added, because
  // glTF allows no empty buffer.
  Bytes finish(std::string_view representation, const nlohmann::ordered_json& ours, const GltfScene& scene = {});

 private:
  Bytes bytes_;
  nlohmann::ordered_json views_ = nlohmann::ordered_json::array();
};

struct ContentFile {
  nlohmann::json ours;                            // the members of the extension
  std::vector<std::span<const std::byte>> views;  // they refer to the decoded file's bytes

  // Returns the bytes of the view that an object names (in the form that ContentFileWriter::add returns), if it has
  // this MIME type.
  std::optional<std::span<const std::byte>> bufferViewBytes(const nlohmann::json& object, const char* mimeType) const;
};

// Decodes only the JSON of a container, without its buffer views. The text is untrusted: returns nothing, with the
// reason in `reason`, if it is not a valid asset or lacks the extension with the expected version and representation.
std::optional<ContentFile> decodeContentHeader(std::string_view text, std::string_view representation,
                                               std::string& reason);

// Decodes a whole file. The bytes are untrusted: returns nothing, with the reason in `reason`, if the container, the
// asset, its buffer views, or the extension's version or representation are invalid.
std::optional<ContentFile> decodeContentFile(std::span<const std::byte> file, std::string_view representation,
                                             std::string& reason);

}  // namespace tessera

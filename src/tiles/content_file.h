// What contents of every representation have in common: a .glb that is a valid glTF 2.0 asset (with an empty scene
// where there is nothing that other programs could draw), whose extension TESSERA_content describes a payload that lies
// in buffer views. docs/tile-format.md, section 5. For codecs, not for their users: it shows JSON.
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/file.h"
#include "tiles/tileset.h"

namespace tessera {

inline constexpr int kContentVersion = 1;
inline constexpr size_t kMostContentJson = size_t{8} << 20;  // bytes
inline constexpr const char* kNoGlb = "is not a binary glTF file of version 2, or is cut short";
inline constexpr const char* kWebP = "image/webp";
inline constexpr const char* kRawBytes = "application/octet-stream";

// What other programs draw of a content: members of the glTF asset itself, each empty where there are none of it.
// Accessors and images name buffer views by the numbers that ContentFileWriter::addView gives.
struct GltfScene {
  using Json = nlohmann::ordered_json;

  Json accessors = Json::array(), meshes = Json::array(), materials = Json::array();
  Json textures = Json::array(), images = Json::array(), samplers = Json::array();
  // In Z-up coordinates of the tile frame. The writer adds a node above those in `roots` that turns them by (x, y, z) →
  // (x, z, -y), since glTF is Y-up.
  Json nodes = Json::array();
  std::vector<size_t> roots;                // indices of `nodes`
  std::vector<std::string> extensionsUsed;  // of the members above: "KHR_materials_unlit"

  bool isEmpty() const { return nodes.empty(); }
};

class ContentFileWriter {
 public:
  // A buffer view that accessors or images name → its number. `target` is glTF's of vertices (34962) and indices
  // (34963); 0 for images.
  size_t addView(std::span<const std::byte> bytes, uint32_t target = 0);
  // {"bufferView": n, "mimeType": ...}: how the extension names it.
  nlohmann::ordered_json add(std::span<const std::byte> bytes, const char* mimeType);
  // `ours`: the extension's members after version and representation. CHECKs that a view was added, as glTF allows no
  // empty buffer.
  Bytes finish(std::string_view representation, const nlohmann::ordered_json& ours, const GltfScene& scene = {});

 private:
  Bytes bytes_;
  nlohmann::ordered_json views_ = nlohmann::ordered_json::array();
};

struct ContentFile {
  nlohmann::json ours;                            // the extension
  std::vector<std::span<const std::byte>> views;  // borrowed from the file

  // The view that an object names (as ContentFileWriter::add writes it), if its mimeType is this one.
  std::optional<std::span<const std::byte>> viewOf(const nlohmann::json& object, const char* mimeType) const;
};

// By the JSON of a container alone, without its buffer views. Untrusted: nothing, and why, where it is no asset or has
// not the extension, its version and the representation as they should be.
std::optional<ContentFile> decodeContentHeader(std::string_view text, std::string_view representation,
                                               std::string& reason);

// Untrusted bytes: nothing, and why, where the container, the asset, its buffer views or the extension's version and
// representation are not as they should be.
std::optional<ContentFile> decodeContentFile(std::span<const std::byte> file, std::string_view representation,
                                             std::string& reason);

}  // namespace tessera

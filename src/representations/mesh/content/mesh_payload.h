// Encodes one content of a `mesh` scene as a file and decodes it (tiles/read_content.h reads files by name). The format
// is described in docs/tile-format.md, section 8.
#pragma once

#include <optional>
#include <span>
#include <string>

#include "base/file.h"
#include "representations/mesh/content/mesh_content.h"
#include "tiles/content.h"

namespace tessera {

struct GltfScene;         // tiles/gltf_scene.h
class ContentFileWriter;  // tiles/content_file.h

inline constexpr uint32_t kMaxSkyEdge = 1024;
inline constexpr float kLargestMeshFeature = 1e6f;

// Returns a human-readable description of the first rule of the format that the content violates, or nothing if it
// violates none.
std::optional<std::string> validationError(const MeshContent& content);

// Returns the content as a .glb file. The same content gives the same bytes with the same libwebp. Throws Error if the
// content or file exceeds the limits of readers, which settings can cause; CHECKs that it violates no other rule.
Bytes encodeMesh(const MeshContent& content);
// Likewise, with an ordinary mesh for other programs, whose buffer views have been added to `file`.
Bytes encodeMesh(const MeshContent& content, ContentFileWriter file, const GltfScene& fallback);

// Decodes untrusted bytes. Returns nothing, with the reason in `reason`, if the file violates the format or would take
// more memory than the limits allow, which is checked before it is allocated.
// `resources`: those of the content, which must be encoders.
std::optional<MeshContent> decodeMesh(std::span<const std::byte> file, std::string& reason,
                                      const ContentLimits& limits = {}, const Resources& resources = {});
// Returns the memory that the decoded content will take, from the JSON of its container alone.
std::optional<uint64_t> decodedMeshBytes(std::string_view json, std::string& reason, const ContentLimits& limits = {});

// Returns the codec of this representation. It decodes to ContentOf<MeshContent>.
const ContentCodec& meshCodec();

}  // namespace tessera

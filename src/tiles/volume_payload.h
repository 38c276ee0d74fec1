// One content of a `volume` scene as a file, and back. docs/tile-format.md, section 6.
#pragma once

#include <optional>
#include <span>
#include <string>

#include "base/file.h"
#include "tiles/tileset.h"
#include "tiles/volume_content.h"

namespace tessera {

inline constexpr uint32_t kMostVoxels = 1024, kMostPlanes = 4096;  // along an axis
inline constexpr uint32_t kMostStored = 606 * 606;                 // macroblocks in a picture of 16383 pixels a side
inline constexpr uint32_t kMostLayers = 8, kMostLayerWidth = 256;  // of the network
inline constexpr float kFarthestInScene = 1e7f;                    // scene units

struct VolumeLimits {
  uint64_t fileBytes = uint64_t{1} << 30;
  uint64_t bytes = uint64_t{1} << 30;  // of the content in memory; decoding takes up to a third more for a moment
  uint32_t parts = 1024;
};

// What readers count of a part that has so many macroblocks, before it is there.
uint64_t texelBytes(const VolumePart& part, uint64_t storedMacroblocks);

// Why the content is none: the first rule of the format that it breaks, for people. Nothing when it is one. Whether
// distances are the right ones is not looked at: files do not hold them.
std::optional<std::string> brokenRule(const VolumeContent& content);

// Why the content is not the one that tileset.json speaks of: it is a surround where that says none, or the other way
// round, or owns what lies outside of the box there. Nothing when it is the one.
std::optional<std::string> brokenPromise(const VolumeContent& content, const TileContent& promised);

// A .glb. The same content gives the same bytes with the same libwebp. Throws Error where it is more than readers take
// (VolumeLimits): settings can cause that. CHECKs that it breaks no rule, and that distances are chebyshevDistances of
// their zeros. Macroblocks come back numbered in the order of their places. `effort` as in lossless_image.h.
Bytes encodeVolume(const VolumeContent& content, int effort = 6);

// Untrusted bytes: nothing, and why in `reason`, where a size, an index, a number or the whole is not as the format has
// it, or where the content would take more memory than the limit; that is known before it is taken.
std::optional<VolumeContent> decodeVolume(std::span<const std::byte> file, std::string& reason,
                                          const VolumeLimits& limits = {});
// The same of a file; throws Error naming it.
VolumeContent readVolume(const fs::path& path, const VolumeLimits& limits = {});
// And it must be the one that tile number `tile` of tileset.json speaks of.
VolumeContent readPromisedVolume(const fs::path& path, size_t tile, const TileContent& promised);
// What a content will take in memory (bytesInMemory), by the JSON of its container alone: its texels are not read.
std::optional<uint64_t> decodedBytesOf(std::string_view json, std::string& reason, const VolumeLimits& limits = {});
uint64_t readDecodedBytes(const fs::path& path, const VolumeLimits& limits = {});

}  // namespace tessera

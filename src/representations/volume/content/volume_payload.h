// One content of a `volume` scene as a file, and back (tiles/read_content.h reads files by name). docs/tile-format.md,
// section 6.
#pragma once

#include <optional>
#include <span>
#include <string>

#include "base/file.h"
#include "representations/volume/content/volume_content.h"
#include "tiles/content.h"

namespace tessera {

inline constexpr uint32_t kMostVoxels = 1024, kMostPlanes = 4096;  // along an axis

// What readers count of a part that has so many macroblocks, before it is there.
uint64_t texelBytes(const VolumePart& part, uint64_t storedMacroblocks);

// Why the content is none: the first rule of the format that it breaks, for people. Nothing when it is one. Whether
// distances are the right ones is not looked at: files do not hold them.
std::optional<std::string> brokenRule(const VolumeContent& content);

// A .glb. The same content gives the same bytes with the same libwebp. Throws Error where it is more than readers take
// (ContentLimits): settings can cause that. CHECKs that it breaks no rule, and that distances are chebyshevDistances of
// their zeros. Macroblocks come back numbered in the order of their places. `effort` as in lossless_image.h.
Bytes encodeVolume(const VolumeContent& content, int effort = 6);

// Untrusted bytes: nothing, and why in `reason`, where a size, an index, a number or the whole is not as the format has
// it, or where the content would take more memory than the limit; that is known before it is taken.
std::optional<VolumeContent> decodeVolume(std::span<const std::byte> file, std::string& reason,
                                          const ContentLimits& limits = {});
// What a content will take in memory (bytesInMemory), by the JSON of its container alone: its texels are not read.
std::optional<uint64_t> decodedVolumeBytes(std::string_view json, std::string& reason,
                                           const ContentLimits& limits = {});

// Its contents are ContentOf<VolumeContent>.
const ContentCodec& volumeCodec();

}  // namespace tessera

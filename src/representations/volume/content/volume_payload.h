// Encodes one content of a `volume` scene as a file and decodes it (tiles/read_content.h reads files by name). See
// docs/tile-format.md, section 6.
#pragma once

#include <optional>
#include <span>
#include <string>

#include "base/file.h"
#include "representations/volume/content/volume_content.h"
#include "tiles/content.h"

namespace tessera {

inline constexpr uint32_t kMaxVoxels = 1024, kMaxPlanes = 4096;  // along an axis

// Returns the bytes that readers count for a part with that many stored macroblocks, before its texels are read.
uint64_t texelBytes(const VolumePart& part, uint64_t storedMacroblocks);

// Returns the first rule of the format that the content breaks, as a description for people, or nothing if it is valid.
// Does not check that distances are correct, because files do not store them.
std::optional<std::string> validationError(const VolumeContent& content);

// Returns the content as a .glb file. The same content always gives the same bytes with the same version of libwebp.
// Throws Error if the content exceeds what readers accept (ContentLimits), which settings can cause. CHECKs that it
// breaks no other rule, and that distances are the chebyshevDistances of their zeros. Decoding numbers macroblocks in
// the order of their positions. `effort`: see lossless_image.h.
Bytes encodeVolume(const VolumeContent& content, int effort = 6);

// Decodes a file of untrusted bytes. Returns nothing, with the cause in `reason`, if a size, an index, a number or the
// structure violates the format, or if the content would take more memory than the limit, which is checked before the
// memory is allocated.
std::optional<VolumeContent> decodeVolume(std::span<const std::byte> file, std::string& reason,
                                          const ContentLimits& limits = {});
// Returns the bytes that a content will take in memory (bytesInMemory), from the JSON of its container alone: texels
// are not read.
std::optional<uint64_t> decodedVolumeBytes(std::string_view json, std::string& reason,
                                           const ContentLimits& limits = {});

// The codec of the representation; its contents are ContentOf<VolumeContent>.
const ContentCodec& volumeCodec();

}  // namespace tessera

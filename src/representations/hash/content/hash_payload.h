// Encodes one content of a `hash` scene as a file and decodes it (tiles/read_content.h reads files by name). The format
// is described in docs/tile-format.md, section 7.
#pragma once

#include <optional>
#include <span>
#include <string>

#include "base/file.h"
#include "representations/hash/content/hash_content.h"
#include "tiles/content.h"

namespace tessera {

// Maxima along an axis. The occupancy bits of 1024³ cells would exceed the largest image that WebP allows.
inline constexpr uint32_t kMaxLattice = 1024, kMaxOccupancyCells = 1016;
inline constexpr uint32_t kMaxTables = HashPart::kMaxTables, kMaxTableResolution = 1 << 16, kMaxTableEntries = 1 << 24;
inline constexpr float kLargestFeature = 1e6f, kLargestLogit = 1e6f;
inline constexpr float kShortestHashStep = 1.0f / 32768, kLongestHashStep = 0.125f;  // fractions of a domain's width

// Returns a human-readable description of the first rule of the format that the content violates, or nothing if it
// violates none. Does not check the values of distances and of coarser occupancy levels, which files do not store.
std::optional<std::string> validationError(const HashContent& content);

// Returns the content as a .glb file. The same content gives the same bytes with the same libwebp. Throws Error if the
// content or file exceeds the limits of readers, which settings can cause; CHECKs that it violates no other rule.
// Decoded macroblocks are numbered in the order of their positions. `effort`: see lossless_image.h.
Bytes encodeHash(const HashContent& content, int effort = 6);

// See decodeVolume and decodedVolumeBytes.
std::optional<HashContent> decodeHash(std::span<const std::byte> file, std::string& reason,
                                      const ContentLimits& limits = {});
std::optional<uint64_t> decodedHashBytes(std::string_view json, std::string& reason, const ContentLimits& limits = {});

// Returns the codec of this representation. It decodes to ContentOf<HashContent>.
const ContentCodec& hashCodec();

}  // namespace tessera

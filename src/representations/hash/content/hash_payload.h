// One content of a `hash` scene as a file, and back (tiles/read_content.h reads files by name). docs/tile-format.md,
// section 7.
#pragma once

#include <optional>
#include <span>
#include <string>

#include "base/file.h"
#include "representations/hash/content/hash_content.h"
#include "tiles/content.h"

namespace tessera {

// Along an axis; the bits of 1024³ cells are no picture that WebP can hold.
inline constexpr uint32_t kMostLattice = 1024, kMostOccupancyCells = 1016;
inline constexpr uint32_t kMostTables = HashPart::kMostTables, kMostTableResolution = 1 << 16,
                          kMostTableEntries = 1 << 24;
inline constexpr float kLargestFeature = 1e6f, kLargestLogit = 1e6f;
inline constexpr float kShortestHashStep = 1.0f / 32768, kLongestHashStep = 0.125f;  // shares of a domain's width

// The first rule of the format that the content breaks, for people. Nothing when it breaks none. Whether distances and
// coarser levels of the occupancy are the right ones is not looked at: files do not hold them.
std::optional<std::string> brokenRule(const HashContent& content);

// A .glb. The same content gives the same bytes with the same libwebp. Throws Error where it is more than readers take:
// settings can cause that. CHECKs that it breaks no rule. Macroblocks come back numbered in the order of their places.
// `effort` as in lossless_image.h.
Bytes encodeHash(const HashContent& content, int effort = 6);

// As decodeVolume, and decodedVolumeBytes.
std::optional<HashContent> decodeHash(std::span<const std::byte> file, std::string& reason,
                                      const ContentLimits& limits = {});
std::optional<uint64_t> decodedHashBytes(std::string_view json, std::string& reason, const ContentLimits& limits = {});

// Its contents are ContentOf<HashContent>.
const ContentCodec& hashCodec();

}  // namespace tessera

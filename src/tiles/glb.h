// The container of binary glTF: a JSON chunk, then at most one chunk of bytes.
// Source: Khronos glTF 2.0 specification, section 4 (GLB file format).
#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "base/file.h"

namespace tessera {

struct GlbView {
  std::string_view json;             // borrowed; with the spaces that pad it
  std::span<const std::byte> bytes;  // borrowed; padding included; empty when there is no such chunk
};

inline constexpr uint64_t kLargestGlb = 0xffffffffu;  // its lengths are 32 bits

// Pads the JSON with spaces and the bytes with zeros, each to a multiple of 4. CHECKs that the whole fits kLargestGlb.
Bytes encodeGlb(std::string_view json, std::span<const std::byte> bytes);

inline constexpr size_t kGlbStart = 20;  // bytes before the JSON
// The length of the JSON that follows, of a file of so many bytes; nothing where these cannot be the first of one.
std::optional<uint32_t> jsonLengthOf(std::span<const std::byte> start, uint64_t fileBytes);

// Nothing unless magic, version (2), total length (exact), order, types and alignment of the chunks are those of the
// specification. Chunks of unknown types after the two are passed over, as it demands.
std::optional<GlbView> decodeGlb(std::span<const std::byte> file);

}  // namespace tessera

// The GLB container of binary glTF: a JSON chunk, followed by at most one binary chunk.
// Source: Khronos glTF 2.0 specification, section 4 (GLB file format).
#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "base/file.h"

namespace tessera {

struct GlbView {
  std::string_view json;             // refers to the file; includes the padding spaces
  std::span<const std::byte> bytes;  // refers to the file; includes padding; empty if there is no binary chunk
};

inline constexpr uint64_t kLargestGlb = 0xffffffffu;  // bytes: GLB stores lengths in 32 bits

// Encodes a GLB. Pads the JSON with spaces and the bytes with zeros, each to a multiple of 4. CHECKs that the file is
// at most kLargestGlb bytes long.
Bytes encodeGlb(std::string_view json, std::span<const std::byte> bytes);
// Returns what precedes the bytes in such a file, for writers that do not hold them in memory. `bytes`: their number, a
// multiple of 4. CHECKs as encodeGlb does.
Bytes encodeGlbStart(std::string_view json, uint64_t bytes);

inline constexpr size_t kGlbStart = 20;  // bytes before the JSON
// Returns the length of the JSON chunk from the first kGlbStart bytes of a file of `fileBytes` bytes; nothing if these
// cannot be the start of a GLB.
std::optional<uint32_t> readJsonLength(std::span<const std::byte> start, uint64_t fileBytes);

// Returns nothing unless magic, version (2), total length (exact) and the order, types and alignment of the chunks
// conform to the glTF specification. Additional chunks of unknown type are ignored, as it requires.
std::optional<GlbView> decodeGlb(std::span<const std::byte> file);

}  // namespace tessera

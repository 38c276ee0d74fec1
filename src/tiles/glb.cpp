#include "tiles/glb.h"

#include <cstring>

#include "base/check.h"

namespace tessera {
namespace {

constexpr uint32_t kMagic = 0x46546c67, kVersion = 2;                  // "glTF"
constexpr uint32_t kJsonChunk = 0x4e4f534a, kBytesChunk = 0x004e4942;  // "JSON", "BIN\0"
constexpr size_t kHeader = 12, kChunkHeader = 8;
static_assert(kGlbStart == kHeader + kChunkHeader);

void put32(std::byte* at, uint32_t value) {
  for (int i = 0; i < 4; ++i) at[i] = static_cast<std::byte>(value >> (8 * i));
}

uint32_t get32(std::span<const std::byte> bytes, size_t at) {
  uint32_t value = 0;
  for (size_t i = 4; i-- > 0;) value = value << 8 | static_cast<uint32_t>(bytes[at + i]);
  return value;
}

size_t padded(size_t length) {
  return (length + 3) / 4 * 4;
}

}  // namespace

Bytes encodeGlbStart(std::string_view json, uint64_t bytes) {
  CHECK(bytes % 4 == 0u);
  const size_t jsonLength = padded(json.size());
  const size_t start = kHeader + kChunkHeader + jsonLength + (bytes == 0 ? 0 : kChunkHeader);
  CHECK(start + bytes <= kLargestGlb);
  Bytes file(start);
  put32(file.data(), kMagic);
  put32(file.data() + 4, kVersion);
  put32(file.data() + 8, static_cast<uint32_t>(start + bytes));
  std::byte* at = file.data() + kHeader;
  put32(at, static_cast<uint32_t>(jsonLength));
  put32(at + 4, kJsonChunk);
  at += kChunkHeader;
  std::memset(at, ' ', jsonLength);
  if (!json.empty()) std::memcpy(at, json.data(), json.size());
  at += jsonLength;
  if (bytes == 0) return file;
  put32(at, static_cast<uint32_t>(bytes));
  put32(at + 4, kBytesChunk);
  return file;
}

Bytes encodeGlb(std::string_view json, std::span<const std::byte> bytes) {
  Bytes file = encodeGlbStart(json, padded(bytes.size()));
  const size_t start = file.size();
  file.resize(start + padded(bytes.size()));
  if (!bytes.empty()) std::memcpy(file.data() + start, bytes.data(), bytes.size());
  return file;
}

std::optional<uint32_t> readJsonLength(std::span<const std::byte> start, uint64_t fileBytes) {
  if (start.size() < kGlbStart || fileBytes < kGlbStart || fileBytes % 4 != 0) return std::nullopt;
  if (get32(start, 0) != kMagic || get32(start, 4) != kVersion || get32(start, 8) != fileBytes) return std::nullopt;
  const uint32_t length = get32(start, kHeader);
  if (get32(start, kHeader + 4) != kJsonChunk || length % 4 != 0 || length > fileBytes - kGlbStart) return std::nullopt;
  return length;
}

std::optional<GlbView> decodeGlb(std::span<const std::byte> file) {
  if (file.size() < kHeader || file.size() % 4 != 0) return std::nullopt;
  if (get32(file, 0) != kMagic || get32(file, 4) != kVersion || get32(file, 8) != file.size()) return std::nullopt;
  GlbView view;
  size_t chunk = 0;
  for (size_t at = kHeader; at < file.size(); ++chunk) {
    if (file.size() - at < kChunkHeader) return std::nullopt;
    const uint32_t length = get32(file, at), type = get32(file, at + 4);
    at += kChunkHeader;
    if (length % 4 != 0 || length > file.size() - at) return std::nullopt;
    const std::span<const std::byte> content = file.subspan(at, length);
    at += length;
    if ((chunk == 0) != (type == kJsonChunk)) return std::nullopt;  // the first chunk is JSON, and no other one is
    if (type == kBytesChunk && chunk != 1) return std::nullopt;     // BIN must be the second chunk
    if (chunk == 0) view.json = {reinterpret_cast<const char*>(content.data()), content.size()};
    if (type == kBytesChunk) view.bytes = content;
  }
  if (chunk == 0) return std::nullopt;
  return view;
}

}  // namespace tessera

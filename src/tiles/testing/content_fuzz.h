// For fuzzers of contents. An input that is not a GLB container is split into JSON and bytes and wrapped in one, so
// that the fuzzer need not guess lengths. fuzzContent checks what must hold for every decoded content.
#pragma once

#include <cstdlib>
#include <cstring>

#include "../../../tests/fuzz/fuzz_input.h"
#include "tiles/content.h"
#include "tiles/glb.h"

namespace tessera {

inline Bytes asContainer(std::span<const std::byte> bytes, const uint8_t* data) {
  if (bytes.size() >= 4 && std::memcmp(data, "glTF", 4) == 0) return Bytes(bytes.begin(), bytes.end());
  FuzzInput input(data, bytes.size());
  const std::string_view json = input.text();
  return encodeGlb(json, input.rest());
}

// Parameters: decodedBytes(json, reason, limits), decode(file, reason, limits), encode(content), same(part, part).
template <class DecodedBytes, class Decode, class Encode, class Same>
void fuzzContent(const uint8_t* data, size_t size, const DecodedBytes& decodedBytes, const Decode& decode,
                 const Encode& encode, const Same& same) {
  const Bytes file = asContainer({reinterpret_cast<const std::byte*>(data), size}, data);
  ContentLimits limits;
  limits.bytes = 1 << 22;
  limits.parts = 4;
  std::string reason;
  // The size that a cache reserves, computed from the headers alone.
  std::optional<uint64_t> bytes;
  if (const auto container = decodeGlb(file)) {
    bytes = decodedBytes(container->json, reason, limits);
    if (bytes.has_value() != reason.empty()) std::abort();
  }
  const auto content = decode(file, reason, limits);
  if (content.has_value() != reason.empty()) std::abort();
  if (!content) return;
  if (validationError(*content)) std::abort();
  if (bytes != bytesInMemory(*content)) std::abort();
  const auto again = decode(encode(*content), reason, limits);
  if (!again || again->parts.size() != content->parts.size()) std::abort();
  for (size_t i = 0; i < again->parts.size(); ++i) {
    if (!same(again->parts[i], content->parts[i])) std::abort();
  }
}

}  // namespace tessera

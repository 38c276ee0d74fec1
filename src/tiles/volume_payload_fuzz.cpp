// Volume contents from arbitrary bytes: bounded, and what is accepted keeps the rules and survives being written. An
// input that is no container is cut into JSON and bytes and put into one, so that lengths need not be guessed.
#include <cstdlib>

#include "../../tests/fuzz/fuzz_input.h"
#include "tiles/glb.h"
#include "tiles/volume_payload.h"

namespace {

tessera::Bytes asContainer(std::span<const std::byte> bytes, const uint8_t* data) {
  if (bytes.size() >= 4 && std::memcmp(data, "glTF", 4) == 0) return tessera::Bytes(bytes.begin(), bytes.end());
  tessera::FuzzInput input(data, bytes.size());
  const std::string_view json = input.text();
  return tessera::encodeGlb(json, input.rest());
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const tessera::Bytes file = asContainer({reinterpret_cast<const std::byte*>(data), size}, data);
  tessera::VolumeLimits limits;
  limits.bytes = 1 << 22;
  limits.parts = 4;
  std::string reason;
  // Which size a cache reckons with, by the headers alone.
  std::optional<uint64_t> bytes;
  if (const auto container = tessera::decodeGlb(file)) {
    bytes = tessera::decodedBytesOf(container->json, reason, limits);
    if (bytes.has_value() != reason.empty()) std::abort();
  }
  const auto content = tessera::decodeVolume(file, reason, limits);
  if (content.has_value() != reason.empty()) std::abort();
  if (!content) return 0;
  if (tessera::brokenRule(*content)) std::abort();
  if (bytes != tessera::bytesInMemory(*content)) std::abort();
  const auto again = tessera::decodeVolume(tessera::encodeVolume(*content, 0), reason, limits);
  if (!again || again->parts.size() != content->parts.size()) std::abort();
  for (size_t i = 0; i < again->parts.size(); ++i) {
    if (again->parts[i].voxelBytes != content->parts[i].voxelBytes) std::abort();
    if (again->parts[i].planeBytes != content->parts[i].planeBytes) std::abort();
    if (again->parts[i].distances != content->parts[i].distances) std::abort();
  }
  return 0;
}

// Decodes encoders of mesh from arbitrary bytes. Memory stays bounded, and every accepted encoder satisfies the rules
// and survives a round trip.
#include "representations/mesh/content/mesh_encoder.h"
#include "tiles/testing/content_fuzz.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace tessera;
  const Bytes file = asContainer({reinterpret_cast<const std::byte*>(data), size}, data);
  ContentLimits limits;
  limits.bytes = 1 << 22;
  std::string reason;
  const auto encoder = decodeMeshEncoder(file, reason, limits);
  if (encoder.has_value() != reason.empty()) std::abort();
  if (!encoder) return 0;
  if (validationError(*encoder)) std::abort();
  const Bytes written = encodeMeshEncoder(*encoder);
  const auto again = decodeMeshEncoder(written, reason, limits);
  if (!again || encodeMeshEncoder(*again) != written) std::abort();
  if (again->table != encoder->table || again->weights != encoder->weights) std::abort();
  return 0;
}

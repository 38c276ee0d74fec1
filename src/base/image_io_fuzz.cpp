// Decodes images and depth maps from arbitrary bytes: no crash, no exception, no allocation beyond the limit.
#include "base/image_io.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const std::span bytes(reinterpret_cast<const std::byte*>(data), size);
  tessera::DecodeLimits limits;
  limits.maxPixels = 1 << 20;
  tessera::probeImage(bytes);
  tessera::decodeImage(bytes, limits);
  tessera::decodeDepth(bytes, 0.001f, limits);
  return 0;
}

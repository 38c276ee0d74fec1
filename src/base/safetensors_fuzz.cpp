// Decodes tensors from arbitrary bytes: an accepted file can be read to its last byte, and written and read again.
#include <cstdlib>

#include "base/safetensors.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const auto* start = reinterpret_cast<const std::byte*>(data);
  const auto file = tessera::decodeSafetensors(tessera::Bytes(start, start + size));
  if (!file) return 0;
  for (const auto& [name, tensor] : file->tensors) {
    if (reinterpret_cast<uintptr_t>(tensor.bytes.data()) % tessera::bytesPerElement(tensor.type) != 0) std::abort();
    volatile std::byte last{};
    if (!tensor.bytes.empty()) last = tensor.bytes.back();
  }
  const auto again = tessera::decodeSafetensors(tessera::encodeSafetensors(file->tensors, file->metadata));
  if (!again || again->tensors.size() != file->tensors.size()) std::abort();
  return 0;
}

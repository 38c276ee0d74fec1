#include "tiles/writer_limits.h"

#include <fmt/format.h>

namespace tessera {

Error contentTooLarge(const std::string& why, const std::string& remedy) {
  return {"a content that was to be written", "", why, remedy};
}

void requireContentWithin(const ContentLimits& limits, size_t parts, uint64_t bytes, const std::string& remedy) {
  if (parts > limits.parts) {
    throw contentTooLarge(fmt::format("merges {} blocks, and readers take {} at most", parts, limits.parts), remedy);
  }
  if (bytes > limits.bytes) {
    throw contentTooLarge(fmt::format("takes {} bytes of memory, and readers take {} at most", bytes, limits.bytes),
                          remedy);
  }
}

void requireFileWithin(const ContentLimits& limits, uint64_t bytes, const std::string& remedy) {
  if (bytes > limits.fileBytes) {
    throw contentTooLarge(fmt::format("takes {} bytes on disk, and readers take {} at most", bytes, limits.fileBytes),
                          remedy);
  }
}

}  // namespace tessera

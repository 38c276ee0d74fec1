#include "gpu/free_ranges.h"

#include "base/check.h"

namespace tessera {

std::optional<size_t> FreeRanges::take(size_t bytes) {
  for (auto range = free_.begin(); range != free_.end(); ++range) {
    const auto [offset, capacity] = *range;
    if (capacity < bytes) continue;
    free_.erase(range);
    if (capacity > bytes) free_[offset + bytes] = capacity - bytes;
    return offset;
  }
  return std::nullopt;
}

void FreeRanges::giveBack(size_t offset, size_t bytes) {
  auto after = free_.lower_bound(offset);
  if (after != free_.end()) {
    CHECK(offset + bytes <= after->first);
    if (offset + bytes == after->first) {
      bytes += after->second;
      after = free_.erase(after);
    }
  }
  if (after != free_.begin()) {
    const auto before = std::prev(after);
    CHECK(before->first + before->second <= offset);
    if (before->first + before->second == offset) {
      before->second += bytes;
      return;
    }
  }
  free_[offset] = bytes;
}

}  // namespace tessera

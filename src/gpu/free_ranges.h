// A first-fit allocator of ranges within a block of memory. It is independent of Vulkan.
#pragma once

#include <cstddef>
#include <map>
#include <optional>

namespace tessera {

class FreeRanges {
 public:
  explicit FreeRanges(size_t size) : size_(size) { free_[0] = size; }

  // Allocates the first free range of `bytes` bytes. Returns its offset, or nothing if no range is large enough.
  std::optional<size_t> take(size_t bytes);
  // Frees a range that `take` returned.
  void giveBack(size_t offset, size_t bytes);
  bool allFree() const { return free_.size() == 1 && free_.begin()->second == size_; }

 private:
  size_t size_;
  std::map<size_t, size_t> free_;  // offset to bytes; adjacent ranges are merged
};

}  // namespace tessera

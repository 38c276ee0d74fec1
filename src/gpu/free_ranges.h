// Which parts of a block of memory are free. Knows nothing of Vulkan.
#pragma once

#include <cstddef>
#include <map>
#include <optional>

namespace tessera {

class FreeRanges {
 public:
  explicit FreeRanges(size_t size) : size_(size) { free_[0] = size; }

  // The first place with so much room; nothing where there is none.
  std::optional<size_t> take(size_t bytes);
  // What was taken.
  void giveBack(size_t offset, size_t bytes);
  bool allFree() const { return free_.size() == 1 && free_.begin()->second == size_; }

 private:
  size_t size_;
  std::map<size_t, size_t> free_;  // offset to bytes; no two touch
};

}  // namespace tessera

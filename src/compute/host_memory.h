// Memory in the address space of the CPU, as allocated by the reference and cpu devices.
#pragma once

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <new>

#include "compute/memory.h"

namespace tessera {

class HostMemory : public Memory {
 public:
  static constexpr size_t kAlignment = 128;

  explicit HostMemory(size_t bytes) : Memory(bytes) {
    const size_t rounded = (bytes + kAlignment - 1) / kAlignment * kAlignment;
    data_ = static_cast<std::byte*>(std::aligned_alloc(kAlignment, rounded));
    if (data_ == nullptr) throw std::bad_alloc();
    std::memset(data_, 0, rounded);
  }
  ~HostMemory() override { std::free(data_); }
  HostMemory(const HostMemory&) = delete;
  HostMemory& operator=(const HostMemory&) = delete;

  std::byte* data() { return data_; }
  const std::byte* data() const { return data_; }

 private:
  std::byte* data_;
};

// The elements of a slice that lives in HostMemory; null for an empty slice.
template <class T>
T* hostPointer(const Slice<T>& slice) {
  if (!slice) return nullptr;
  return reinterpret_cast<T*>(static_cast<HostMemory*>(slice.memory)->data()) + slice.first;
}

// Whether any counter is above `maximum` (see Adam::overflowCounters).
inline bool isAnyAbove(const Slice<const uint32_t>& counters, uint32_t maximum) {
  const uint32_t* values = hostPointer(counters);
  return std::any_of(values, values + counters.count, [&](uint32_t value) { return value > maximum; });
}

// The rows [begin, end) that an operation works on.
struct HostRows {
  uint32_t begin = 0, end = 0;
  uint32_t count() const { return end - begin; }
};
inline HostRows hostRows(const Count& count) {
  HostRows rows{0, count.capacity};
  if (count.counter) rows.end = std::min(*hostPointer(count.counter), count.capacity);
  if (count.first) rows.begin = std::min(*hostPointer(count.first), rows.end);
  return rows;
}
// The number of rows of an operation that always begins at row 0.
inline uint32_t hostCount(const Count& count) {
  CHECK(!count.first);
  return hostRows(count).end;
}

}  // namespace tessera

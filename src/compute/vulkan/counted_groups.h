// Workgroup counts for rows that only the device counts: the device writes the count, and kernels are dispatched
// indirectly. A count is written before the first kernel that uses it, and again once its row counters may have
// changed. Its address is independent of the capacity for rows, so that steps with different numbers of rays have the
// same commands.
//
// Kernels distribute their rows over any number of workgroups, so an outdated count only costs time.
#pragma once

#include <compare>
#include <map>
#include <vector>

#include "gpu/stream.h"
#include "shaders/compute/arguments.h"
#include "shaders/compute/arguments_groups.h"

namespace tessera {

// Limits of the workgroup counts. 0 selects the default of the device.
struct GroupBounds {
  // If the capacity for rows needs fewer groups than this, all of them are dispatched without counting. An empty group
  // costs about 10 μs with a driver for the CPU and a few ns on a GPU; counting costs a few μs.
  uint32_t minimum = 0;
  uint32_t maximum = 0;  // the largest number of groups along x
};

class CountedGroups {
 public:
  CountedGroups(const std::shared_ptr<const GpuContext>& context, const GroupBounds& bounds);

  // Returns enough groups along x of `perGroup` elements for `elements` per row of `rows`, and `y` groups along y; at
  // least one group along x if the capacity is not 0. `mayCount` states whether `rows` has a counter. Queues the kernel
  // that counts if necessary.
  Groups of(GpuStream& stream, const arguments::CountArguments& rows, bool mayCount, uint32_t elements,
            uint32_t perGroup, uint32_t y);
  // Must be called for every write to memory that may contain counters.
  void changed(uint64_t address, size_t bytes);

 private:
  // The rows, and how they are distributed over groups.
  struct Rows {
    uint64_t counter = 0, first = 0;  // addresses
    uint32_t elements = 0, perGroup = 0, y = 0;
    auto operator<=>(const Rows&) const = default;
  };
  struct Counted {
    uint64_t counter = 0, first = 0;
    uint32_t capacity = 0;
    bool isCurrent = false;
  };

  GroupBounds bounds_;
  uint32_t maxY_;
  GpuKernel countGroups_;
  GpuBuffer groups_;  // [kPlaces] VkDispatchIndirectCommand
  std::map<Rows, size_t> places_;
  std::vector<Counted> counted_;  // [place]
};

}  // namespace tessera

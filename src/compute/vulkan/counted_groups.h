// Workgroups for rows that only the device counts: it writes how many there are, and kernels are dispatched by that
// (indirectly). Written once, before the first kernel that takes them, and again once their counters may have changed.
//
// Kernels share rows out among whatever groups they get, so that a number that is out of date costs time alone.
#pragma once

#include <compare>
#include <map>

#include "gpu/stream.h"
#include "shaders/compute/arguments.h"
#include "shaders/compute/arguments_groups.h"

namespace tessera {

// What is worth counting.
struct GroupBounds {
  uint32_t fewest = 64;  // rows whose buffers need no more groups get those uncounted: empty groups cost less
  uint32_t most = 0;     // groups at most
};

class CountedGroups {
 public:
  CountedGroups(const std::shared_ptr<const GpuContext>& context, const GroupBounds& bounds);

  // Enough groups along x of `perGroup` for `elements` of each of `rows`, times `y`: one at least, where there is room
  // for a row. `mayCount`: rows has a counter.
  Groups of(GpuStream& stream, const arguments::CountArguments& rows, bool mayCount, uint32_t elements,
            uint32_t perGroup, uint32_t y);
  // To be said of all that is written where counters may lie.
  void changed(uint64_t address, size_t bytes);

 private:
  // How many rows, and what a group takes of them.
  struct Rows {
    uint64_t counter = 0, first = 0;  // addresses
    uint32_t capacity = 0, elements = 0, perGroup = 0, y = 0;
    auto operator<=>(const Rows&) const = default;
  };
  struct Counted {
    size_t place = 0;  // in `groups_`
    bool isCurrent = false;
  };

  GroupBounds bounds_;
  GpuKernel countGroups_;
  GpuBuffer groups_;  // [kPlaces]: what vkCmdDispatchIndirect reads
  std::map<Rows, Counted> counted_;
};

}  // namespace tessera

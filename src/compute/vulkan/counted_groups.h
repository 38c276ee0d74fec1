// Workgroups for rows that only the device counts: it writes how many there are, and kernels are dispatched by that
// (indirectly). Written before the first kernel that takes such groups of such rows, and again once their counters may
// have changed. Their place stays the same however much room there is for rows: steps with other numbers of rays are
// the same list of commands.
//
// Kernels share rows out among whatever groups they get, so that a number that is out of date costs time alone.
#pragma once

#include <compare>
#include <map>
#include <vector>

#include "gpu/stream.h"
#include "shaders/compute/arguments.h"
#include "shaders/compute/arguments_groups.h"

namespace tessera {

// What is worth counting. 0: as suits the device.
struct GroupBounds {
  // Rows whose buffers need fewer groups get those uncounted. An empty group costs a driver that computes on the
  // processor some 10 μs, and a card some ns, where to count costs some μs.
  uint32_t fewest = 0;
  uint32_t most = 0;  // groups at most
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
  // Which rows, and what a group takes of them.
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
  uint32_t mostY_;
  GpuKernel countGroups_;
  GpuBuffer groups_;  // [kPlaces]: what vkCmdDispatchIndirect reads
  std::map<Rows, size_t> places_;
  std::vector<Counted> counted_;  // [place]
};

}  // namespace tessera

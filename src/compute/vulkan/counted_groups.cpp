#include "compute/vulkan/counted_groups.h"

#include <algorithm>
#include <span>

#include "base/check.h"
#include "shaders/count_groups.h"

namespace tessera {

namespace {

constexpr size_t kPlaces = 4096;
constexpr size_t kPlaceBytes = 16;

}  // namespace

CountedGroups::CountedGroups(const std::shared_ptr<const GpuContext>& context, const GroupBounds& bounds)
    : bounds_(bounds),
      maxY_(context->limits().maxComputeWorkGroupCount[1]),
      countGroups_(context, kCountGroupsSpirv),
      groups_(context, kPlaces * kPlaceBytes) {
  const uint32_t limit = context->limits().maxComputeWorkGroupCount[0];
  bounds_.maximum = bounds.maximum == 0 ? limit : std::min(bounds.maximum, limit);
  if (bounds.minimum == 0) bounds_.minimum = context->isCpu() ? 64 : 2048;
}

Groups CountedGroups::of(GpuStream& stream, const arguments::CountArguments& rows, bool mayCount, uint32_t elements,
                         uint32_t perGroup, uint32_t y) {
  CHECK(size_t{rows.capacity} * elements < size_t{1} << 32);
  CHECK(y <= maxY_);
  const size_t maximum = (size_t{rows.capacity} * elements + perGroup - 1) / perGroup;
  if (!mayCount || maximum < bounds_.minimum) return {workgroups(maximum, 1, bounds_.maximum), y};
  const Rows key = {rows.counter, rows.first, elements, perGroup, y};
  if (places_.size() == kPlaces && !places_.contains(key)) {
    places_.clear();
    counted_.clear();
  }
  const size_t place = places_.try_emplace(key, places_.size()).first->second;
  if (place == counted_.size()) counted_.push_back({rows.counter, rows.first});
  Counted& counted = counted_[place];
  if (!counted.isCurrent || counted.capacity != rows.capacity) {
    arguments::CountGroupsArguments arguments = {};
    arguments.rows = rows;
    arguments.groups = groups_.address() + place * kPlaceBytes;
    arguments.elements = elements;
    arguments.perGroup = perGroup;
    arguments.maximum = bounds_.maximum;
    arguments.y = y;
    stream.run(countGroups_, std::as_bytes(std::span(&arguments, 1)), {});
    counted.capacity = rows.capacity;
    counted.isCurrent = true;
  }
  return Groups::counted(groups_, place * kPlaceBytes);
}

void CountedGroups::changed(uint64_t address, size_t bytes) {
  const auto isThere = [&](uint64_t word) { return address <= word && word < address + bytes; };
  for (Counted& counted : counted_) {
    if (isThere(counted.counter) || isThere(counted.first)) counted.isCurrent = false;
  }
}

}  // namespace tessera

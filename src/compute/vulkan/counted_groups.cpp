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
    : bounds_(bounds), countGroups_(context, kCountGroupsSpirv), groups_(context, kPlaces * kPlaceBytes) {
  const uint32_t limit = context->limits().maxComputeWorkGroupCount[0];
  bounds_.most = bounds.most == 0 ? limit : std::min(bounds.most, limit);
}

Groups CountedGroups::of(GpuStream& stream, const arguments::CountArguments& rows, bool mayCount, uint32_t elements,
                         uint32_t perGroup, uint32_t y) {
  CHECK(size_t{rows.capacity} * elements < size_t{1} << 32);
  const uint32_t most = workgroups(size_t{rows.capacity} * elements, perGroup, bounds_.most);
  if (!mayCount || most <= bounds_.fewest) return {most, y};
  const Rows key = {rows.counter, rows.first, rows.capacity, elements, perGroup, y};
  if (counted_.size() == kPlaces && !counted_.contains(key)) counted_.clear();
  Counted& counted = counted_.try_emplace(key, Counted{counted_.size() * kPlaceBytes, false}).first->second;
  if (!counted.isCurrent) {
    arguments::CountGroupsArguments arguments = {};
    arguments.rows = rows;
    arguments.groups = groups_.address() + counted.place;
    arguments.elements = elements;
    arguments.perGroup = perGroup;
    arguments.most = bounds_.most;
    arguments.y = y;
    stream.run(countGroups_, std::as_bytes(std::span(&arguments, 1)), {});
    counted.isCurrent = true;
  }
  return Groups::counted(groups_, counted.place);
}

void CountedGroups::changed(uint64_t address, size_t bytes) {
  const auto isThere = [&](uint64_t word) { return address <= word && word < address + bytes; };
  for (auto& [rows, counted] : counted_) {
    if (isThere(rows.counter) || isThere(rows.first)) counted.isCurrent = false;
  }
}

}  // namespace tessera

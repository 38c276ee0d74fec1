// Prefix sums and reductions, which several operations use.
#include "compute/vulkan/vulkan_device.h"
#include "shaders/add_partials.h"
#include "shaders/add_partials_subgroups.h"
#include "shaders/compute/arguments_scan.h"
#include "shaders/scan_apply.h"
#include "shaders/scan_offsets.h"
#include "shaders/scan_partials.h"

namespace tessera {

namespace {

constexpr size_t kChunk = TESSERA_SCAN_CHUNK;

}  // namespace

size_t VulkanDevice::scanScratch(size_t rows) {
  return std::max<size_t>((rows + kChunk - 1) / kChunk, 1);
}

void VulkanDevice::queueRunningSums(const RunningSums& sums) {
  CHECK(sums.limit <= kNoLimit);
  CHECK(!sums.rows.first);
  arguments::ScanArguments arguments = {};
  arguments.rows = countArguments(sums.rows);
  arguments.counts = sums.marks ? sums.marks : sums.values;
  arguments.values = sums.values;
  arguments.partials = sums.scratch;
  arguments.total = sums.total;
  arguments.fitting = sums.fitting;
  arguments.partialCount = static_cast<uint32_t>(scanScratch(sums.rows.capacity));
  arguments.limit = sums.limit;
  const Groups chunks = {groups(arguments.partialCount, 1)};
  const bool ofMarks = sums.marks != 0;
  queue(kernel(kScanPartialsSpirv, {ofMarks}), arguments, chunks);
  queue(kernel(kScanOffsetsSpirv), arguments, {1});
  queue(kernel(kScanApplySpirv, {ofMarks, ofMarks}), arguments, chunks);
}

void VulkanDevice::addPartials(uint64_t partials, uint32_t count, uint32_t columns, uint64_t sums) {
  queue(kernel(groupSpirv(kAddPartialsSubgroupsSpirv, kAddPartialsSpirv)),
        arguments::AddPartialsArguments{partials, sums, count, columns}, {columns});
}

}  // namespace tessera

#include "compute/blocks.h"

#include "base/random.h"
#include "compute/vulkan/block_space.h"
#include "compute/vulkan/vulkan_device.h"
#include "shaders/block_points.h"
#include "shaders/block_points_float64.h"
#include "shaders/block_samples.h"
#include "shaders/block_samples_float64.h"
#include "shaders/compute/arguments_blocks.h"
#include "shaders/enter_scene.h"
#include "shaders/enter_scene_float64.h"
#include "shaders/group_by_block.h"

namespace tessera {

namespace {

constexpr uint32_t kBlockRaysPerGroup = 64;  // local_size_x of the kernels that take rays
constexpr uint32_t kRowsPerShare = TESSERA_ROWS_OF_SHARE;

}  // namespace

template <>
void VulkanDevice::enqueue(const EnterScene& options) {
  arguments::EnterSceneArguments arguments = {};
  arguments.space = spaceArguments(options.space);
  arguments.rays = countArguments(options.rays);
  arguments.origins = deviceAddress(options.origins);
  arguments.directions = deviceAddress(options.directions);
  arguments.jitter = deviceAddress(options.jitter);
  arguments.nearOfRay = deviceAddress(options.nearOfRay);
  arguments.range = deviceAddress(options.range);
  arguments.fences = deviceAddress(options.fences);
  arguments.intervals = options.intervals;
  queue(realKernel(kEnterSceneFloat64Spirv, kEnterSceneSpirv), arguments,
        countGroups(options.rays, 128, options.intervals + 1));
}

template <>
void VulkanDevice::enqueue(const BlockSamples& options) {
  const size_t rays = options.rays.capacity;
  CHECK(!options.rays.first);
  arguments::BlockSamplesArguments arguments = {};
  arguments.space = spaceArguments(options.space);
  arguments.rays = countArguments(options.rays);
  arguments.intervals = options.intervals;
  arguments.firstRow = options.firstRow;
  arguments.texels = options.texels;
  arguments.origins = deviceAddress(options.origins);
  arguments.directions = deviceAddress(options.directions);
  arguments.range = deviceAddress(options.range);
  arguments.farOfRay = deviceAddress(options.farOfRay);
  arguments.fences = deviceAddress(options.fences);
  arguments.slotOfBlock = deviceAddress(options.slotOfBlock);
  arguments.groupOfBlock = deviceAddress(options.groupOfBlock);
  arguments.firstSample = deviceAddress(options.firstSample);
  arguments.rowCount = deviceAddress(options.rowCount);
  arguments.blockOfSample = deviceAddress(options.blockOfSample);
  arguments.positions = deviceAddress(options.positions);
  arguments.distances = deviceAddress(options.distances);
  arguments.steps = deviceAddress(options.steps);
  arguments.middles = deviceAddress(options.middles);
  arguments.widths = deviceAddress(options.widths);
  arguments.runtimeSteps = deviceAddress(options.runtimeSteps);
  arguments.firstSegment = deviceAddress(options.firstSegment);
  arguments.segmentCount = deviceAddress(options.segmentCount);
  arguments.firstSampleOfSegment = deviceAddress(options.firstSampleOfSegment);
  arguments.groupOfSegment = deviceAddress(options.groupOfSegment);
  arguments.rayOfSegment = deviceAddress(options.rayOfSegment);
  if (options.split) {
    arguments.sampleCounts = scratch(2 * rays + 2 + scanScratch(rays));
    arguments.segmentCounts = arguments.sampleCounts + rays * sizeof(uint32_t);
    const uint64_t total = arguments.segmentCounts + rays * sizeof(uint32_t);
    queue(realKernel(kBlockSamplesFloat64Spirv, kBlockSamplesSpirv, {false, true}), arguments,
          {groups(rays, kBlockRaysPerGroup)});
    for (const uint64_t counts : {arguments.sampleCounts, arguments.segmentCounts}) {
      queueRunningSums({.rows = options.rays,
                        .values = counts,
                        .total = total,
                        .fitting = total + sizeof(uint32_t),
                        .limit = kNoLimit,
                        .scratch = total + 2 * sizeof(uint32_t)});
    }
  }
  queue(realKernel(kBlockSamplesFloat64Spirv, kBlockSamplesSpirv, {true, options.split}), arguments,
        {groups(rays + 1, kBlockRaysPerGroup)});
  countersChanged(options.rowCount);
  countersChanged(options.segmentCount);
}

template <>
void VulkanDevice::enqueue(const BlockPoints& options) {
  CHECK(options.points < 1u << 29);  // the indices of random numbers must not overflow
  if (options.points > 0) CHECK(options.blocks.count > 0u);
  arguments::BlockPointsArguments arguments = {};
  arguments.space = spaceArguments(options.space);
  arguments.key = RandomStream(options.seed, 0x5ba).key;
  arguments.points = options.points;
  arguments.texels = options.texels;
  arguments.blockCount = static_cast<uint32_t>(options.blocks.count);
  arguments.blocks = deviceAddress(options.blocks);
  arguments.slotOfBlock = deviceAddress(options.slotOfBlock);
  arguments.blockOfSample = deviceAddress(options.blockOfSample);
  arguments.positions = deviceAddress(options.positions);
  arguments.runtimeSteps = deviceAddress(options.runtimeSteps);
  queue(realKernel(kBlockPointsFloat64Spirv, kBlockPointsSpirv), arguments, {groups(options.points, 128)});
}

template <>
void VulkanDevice::enqueue(const GroupByBlock& options) {
  const uint32_t shares = std::max((options.samples.capacity + kRowsPerShare - 1) / kRowsPerShare, 1u);
  const size_t counts = size_t{shares} * options.blocks;
  requireIndexable(counts);
  arguments::GroupByBlockArguments arguments = {};
  arguments.samples = countArguments(options.samples);
  arguments.blockOfSample = deviceAddress(options.blockOfSample);
  arguments.counts = scratch(counts + 2 + scanScratch(counts));
  arguments.firstOfBlock = deviceAddress(options.firstOfBlock);
  arguments.source = deviceAddress(options.source);
  arguments.blocks = options.blocks;
  arguments.shares = shares;
  stream_->fillZero(scratch_, 0, counts * sizeof(uint32_t));
  const Groups all = {groups(shares, 64)};
  queue(kernel(kGroupByBlockSpirv, {false}), arguments, all);
  const uint64_t total = arguments.counts + counts * sizeof(uint32_t);
  queueRunningSums({.rows = {static_cast<uint32_t>(counts)},
                    .values = arguments.counts,
                    .total = total,
                    .fitting = total + sizeof(uint32_t),
                    .limit = kNoLimit,
                    .scratch = total + 2 * sizeof(uint32_t)});
  queue(kernel(kGroupByBlockSpirv, {true}), arguments, all);
  countersChanged(options.firstOfBlock);
}

}  // namespace tessera

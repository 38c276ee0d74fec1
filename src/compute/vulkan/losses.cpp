#include "compute/losses.h"

#include "compute/vulkan/vulkan_device.h"
#include "shaders/colour_loss.h"
#include "shaders/colour_loss_subgroups.h"
#include "shaders/compute/arguments_losses.h"
#include "shaders/depth_loss.h"
#include "shaders/depth_loss_subgroups.h"
#include "shaders/distortion_loss.h"
#include "shaders/distortion_loss_subgroups.h"
#include "shaders/dither_loss.h"
#include "shaders/dither_loss_subgroups.h"
#include "shaders/opacity_loss.h"
#include "shaders/opacity_loss_subgroups.h"
#include "shaders/s3im_loss.h"
#include "shaders/s3im_loss_float_atomics.h"
#include "shaders/s3im_loss_subgroups.h"
#include "shaders/s3im_loss_subgroups_float_atomics.h"
#include "shaders/s3im_orders.h"
#include "shaders/sparsity_loss.h"
#include "shaders/sparsity_loss_subgroups.h"

namespace tessera {

namespace {

constexpr uint32_t kSummedPerGroup = 256;  // local_size_x of the kernels that sum

template <class Options>
arguments::RayLossArguments rayLossArguments(const VulkanDevice& device, const Options& options) {
  arguments::RayLossArguments arguments = {};
  arguments.rays = device.countArguments(options.rays);
  arguments.scale = options.scale;
  arguments.firstSample = deviceAddress(options.firstSample);
  arguments.weights = deviceAddress(options.weights);
  arguments.gradients = deviceAddress(options.weightGradients);
  return arguments;
}

}  // namespace

template <>
void VulkanDevice::enqueue(const ColourLoss& options) {
  arguments::ColourLossArguments arguments = {};
  arguments.rays = countArguments(options.rays);
  arguments.kind = static_cast<uint32_t>(options.kind);
  arguments.parameter = options.parameter;
  arguments.scale = options.scale;
  arguments.predicted = deviceAddress(options.predicted);
  arguments.target = deviceAddress(options.target);
  arguments.weights = deviceAddress(options.weights);
  arguments.gradients = deviceAddress(options.gradients);
  queueSums(kernel(groupSpirv(kColourLossSubgroupsSpirv, kColourLossSpirv)), arguments,
            atLeastOneGroup(3 * size_t{options.rays.capacity}, kSummedPerGroup), 2, deviceAddress(options.loss));
}

template <>
void VulkanDevice::enqueue(const DistortionLoss& options) {
  arguments::RayLossArguments arguments = rayLossArguments(*this, options);
  arguments.normalised = options.normalised;
  arguments.distances = deviceAddress(options.distances);
  arguments.steps = deviceAddress(options.steps);
  queueSums(kernel(groupSpirv(kDistortionLossSubgroupsSpirv, kDistortionLossSpirv)), arguments,
            atLeastOneGroup(options.rays.capacity, kSummedPerGroup), 1, deviceAddress(options.loss));
}

template <>
void VulkanDevice::enqueue(const DepthLoss& options) {
  arguments::RayLossArguments arguments = rayLossArguments(*this, options);
  arguments.tolerance = options.tolerance;
  arguments.distances = deviceAddress(options.distances);
  arguments.known = deviceAddress(options.known);
  queueSums(kernel(groupSpirv(kDepthLossSubgroupsSpirv, kDepthLossSpirv)), arguments,
            atLeastOneGroup(options.rays.capacity, kSummedPerGroup), 1, deviceAddress(options.loss));
}

template <>
void VulkanDevice::enqueue(const S3imLoss& options) {
  const size_t rays = options.rays.capacity;
  const uint32_t parts = atLeastOneGroup(3 * options.patches * (rays / 16), kSummedPerGroup);
  arguments::S3imArguments arguments = {};
  arguments.rays = countArguments(options.rays);
  arguments.patches = options.patches;
  arguments.scale = options.scale;
  arguments.seed = options.seed;
  arguments.predicted = deviceAddress(options.predicted);
  arguments.target = deviceAddress(options.target);
  arguments.weights = deviceAddress(options.weights);
  arguments.partials = scratch(parts + options.patches * rays);
  arguments.orders = arguments.partials + parts * sizeof(float);
  arguments.gradients = deviceAddress(options.gradients);
  // Every usable device has 32 KiB of shared memory, of which the exchanges, one per lane, need 1 KiB.
  const bool isLarge = stream_->context()->limits().maxComputeSharedMemorySize >= 34 << 10;
  queue(kernel(kS3imOrdersSpirv, {isLarge ? 8192u : 7168u}), arguments, {options.patches});
  queue(sumKernel(groupSpirv(kS3imLossSubgroupsFloatAtomicsSpirv, kS3imLossFloatAtomicsSpirv),
                  groupSpirv(kS3imLossSubgroupsSpirv, kS3imLossSpirv)),
        arguments, {parts});
  addPartials(arguments.partials, parts, 1, deviceAddress(options.loss));
}

template <>
void VulkanDevice::enqueue(const OpacityLoss& options) {
  arguments::NumberLossArguments arguments = {};
  arguments.numbers = countArguments(options.segments);
  arguments.scale = options.scale;
  arguments.values = deviceAddress(options.opacities);
  arguments.gradients = deviceAddress(options.opacityGradients);
  queueSums(kernel(groupSpirv(kOpacityLossSubgroupsSpirv, kOpacityLossSpirv)), arguments,
            atLeastOneGroup(options.segments.capacity, kSummedPerGroup), 1, deviceAddress(options.loss));
}

template <>
void VulkanDevice::enqueue(const SparsityLoss& options) {
  arguments::NumberLossArguments arguments = {};
  arguments.numbers = countArguments(options.points);
  arguments.scale = options.scale;
  arguments.values = deviceAddress(options.logDensities);
  arguments.runtimeSteps = deviceAddress(options.runtimeSteps);
  arguments.gradients = deviceAddress(options.gradients);
  queueSums(kernel(groupSpirv(kSparsityLossSubgroupsSpirv, kSparsityLossSpirv)), arguments,
            atLeastOneGroup(options.points.capacity, kSummedPerGroup), 1, deviceAddress(options.loss));
}

template <>
void VulkanDevice::enqueue(const DitherLoss& options) {
  CHECK(options.colours.columns == 3u);
  CHECK(options.colourGradients.columns == 3u);
  arguments::DitherLossArguments arguments = {};
  arguments.rays = countArguments(options.rays);
  arguments.rayWeights = deviceAddress(options.rayWeights);
  arguments.firstSample = deviceAddress(options.firstSample);
  arguments.weights = deviceAddress(options.weights);
  arguments.colours = matrixArguments(options.colours, 0);
  arguments.colour = deviceAddress(options.colour);
  arguments.opacity = deviceAddress(options.opacity);
  arguments.background = deviceAddress(options.background);
  arguments.weightGradients = deviceAddress(options.weightGradients);
  arguments.colourGradients = matrixArguments(options.colourGradients, 0);
  arguments.rayColourGradients = deviceAddress(options.rayColourGradients);
  arguments.rayOpacityGradients = deviceAddress(options.rayOpacityGradients);
  arguments.scale = options.scale;
  queueSums(kernel(groupSpirv(kDitherLossSubgroupsSpirv, kDitherLossSpirv)), arguments,
            atLeastOneGroup(options.rays.capacity, kSummedPerGroup), 1, deviceAddress(options.loss));
}

}  // namespace tessera

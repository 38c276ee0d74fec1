#include "compute/proposals.h"

#include "compute/vulkan/vulkan_device.h"
#include "shaders/compute/arguments_losses.h"
#include "shaders/compute/arguments_proposals.h"
#include "shaders/interlevel_loss.h"
#include "shaders/interlevel_loss_float64.h"
#include "shaders/interlevel_loss_subgroups.h"
#include "shaders/interlevel_loss_subgroups_float64.h"
#include "shaders/resample_fences.h"
#include "shaders/resample_fences_float64.h"

namespace tessera {

template <>
void VulkanDevice::enqueue(const ResampleFences& options) {
  arguments::ResampleFencesArguments arguments = {};
  arguments.rays = countArguments(options.rays);
  arguments.before = options.before;
  arguments.after = options.after;
  arguments.anneal = options.anneal;
  arguments.uniformFraction = options.uniformFraction;
  arguments.fences = deviceAddress(options.fences);
  arguments.weights = deviceAddress(options.weights);
  arguments.jitter = deviceAddress(options.jitter);
  arguments.resampled = deviceAddress(options.resampled);
  queue(realKernel(kResampleFencesFloat64Spirv, kResampleFencesSpirv), arguments, countGroups(options.rays, 64));
}

template <>
void VulkanDevice::enqueue(const InterlevelLoss& options) {
  arguments::RayLossArguments arguments = {};
  arguments.rays = countArguments(options.rays);
  arguments.scale = options.scale;
  arguments.intervals = options.intervals;
  arguments.firstSample = deviceAddress(options.firstSample);
  arguments.weights = deviceAddress(options.weights);
  arguments.fences = deviceAddress(options.fences);
  arguments.middles = deviceAddress(options.middles);
  arguments.widths = deviceAddress(options.widths);
  arguments.sampleWeights = deviceAddress(options.sampleWeights);
  arguments.gradients = deviceAddress(options.weightGradients);
  queueSums(realKernel(groupSpirv(kInterlevelLossSubgroupsFloat64Spirv, kInterlevelLossFloat64Spirv),
                       groupSpirv(kInterlevelLossSubgroupsSpirv, kInterlevelLossSpirv)),
            arguments, atLeastOneGroup(options.rays.capacity, 256), 1, deviceAddress(options.loss));
}

}  // namespace tessera

#include "compute/adam.h"

#include "compute/vulkan/vulkan_device.h"
#include "shaders/adam.h"
#include "shaders/compute/arguments_adam.h"

namespace tessera {

template <>
void VulkanDevice::enqueue(const Adam& options) {
  const size_t count = options.parameters.count;
  requireIndexable(count);
  CHECK(options.gradients.count == count);
  CHECK(options.firstMoments.count == count);
  CHECK(options.secondMoments.count == count);
  CHECK(options.counts.count == count);
  arguments::AdamArguments arguments = {};
  arguments.parameters = deviceAddress(options.parameters);
  arguments.gradients = deviceAddress(options.gradients);
  arguments.firstMoments = deviceAddress(options.firstMoments);
  arguments.secondMoments = deviceAddress(options.secondMoments);
  arguments.counts = deviceAddress(options.counts);
  arguments.rows = options.rows ? deviceAddress(options.rows) : noCounter_.address();
  arguments.overflowCounters = noCounter_.address();
  if (options.overflowCounters) {
    arguments.overflowCounters = deviceAddress(options.overflowCounters);
    arguments.overflowCounterCount = static_cast<uint32_t>(options.overflowCounters.count);
    arguments.capacity = options.capacity;
  }
  arguments.count = static_cast<uint32_t>(count);
  arguments.skipZeroGradients = options.skipZeroGradients;
  arguments.rate = options.rate;
  arguments.beta1 = options.beta1;
  arguments.beta2 = options.beta2;
  arguments.epsilon = options.epsilon;
  arguments.l2 = options.l2;
  arguments.bound = options.bound;
  queue(kernel(kAdamSpirv), arguments, {groups(count, 256)});
}

}  // namespace tessera

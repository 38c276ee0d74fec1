#include "compute/mlp.h"

#include <algorithm>

#include "compute/vulkan/vulkan_device.h"
#include "shaders/compute/arguments_mlp.h"
#include "shaders/mlp_backward.h"
#include "shaders/mlp_forward.h"
#include "shaders/mlp_weight_gradients.h"
#include "shaders/mlp_weight_gradients_float_atomics.h"

namespace tessera {

namespace {

constexpr uint32_t kWeightTile = 32;         // mlp_weight_gradients.comp: weights of a workgroup, squared
constexpr uint32_t kSamplesPerShare = 1024;  // samples that one workgroup there should at least sum
constexpr uint32_t kMostShares = 64;         // each weight is added to by so many workgroups at most

// How a network's kernels are built: see mlp_tile.glsl.
struct Block {
  uint32_t width, samples, stateWidth;
  std::vector<uint32_t> constants() const { return {width, samples, stateWidth}; }
};

Block blockFor(const MlpShape& shape, uint32_t stateWidth) {
  CHECK(shape.width % 16 == 0);
  CHECK(16 <= shape.width);
  CHECK(shape.hiddenLayers >= 1);
  CHECK(stateWidth <= 128u);  // so that a block fits in 32 KiB of shared memory
  return {static_cast<uint32_t>(shape.width), stateWidth <= 64 ? 64u : 32u, stateWidth};
}

}  // namespace

void VulkanDevice::enqueue(const MlpForward& options) {
  const MlpShape& shape = options.shape;
  const size_t capacity = options.samples.capacity;
  CHECK(options.input.columns == static_cast<uint32_t>(shape.inputs));
  CHECK(options.output.columns <= static_cast<uint32_t>(shape.outputs));
  CHECK(options.weights.count == shape.parameters());
  CHECK(capacity * shape.activationsPerSample() < size_t{1} << 31);

  arguments::MlpForwardArguments arguments = {};
  arguments.samples = partArguments(options.samples);
  arguments.inputs = matrixArguments(options.input, capacity);
  arguments.outputs = matrixArguments(options.output, capacity);
  arguments.weights = deviceAddress(options.weights);
  arguments.activations = deviceAddress(options.activations);
  arguments.paddedInputs = shape.layerInputs(0);
  arguments.paddedOutputs = shape.layerOutputs(shape.hiddenLayers);
  arguments.hiddenLayers = shape.hiddenLayers;
  arguments.sigmoidOutput = shape.activation == OutputActivation::sigmoid;
  const Block block = blockFor(shape, shape.width);
  queue(kernel(kMlpForwardSpirv, block.constants()), arguments, {groups(capacity, block.samples)});
}

void VulkanDevice::enqueue(const MlpBackward& options) {
  const MlpShape& shape = options.shape;
  const uint32_t width = shape.width, hiddenLayers = shape.hiddenLayers;
  const uint32_t paddedOutputs = shape.layerOutputs(shape.hiddenLayers);
  const size_t capacity = options.samples.capacity;
  const size_t hiddenFloats = capacity * shape.activationsPerSample();
  CHECK(options.input.columns == static_cast<uint32_t>(shape.inputs));
  CHECK(options.weights.count == shape.parameters());
  CHECK(options.weightGradients.count == shape.parameters());
  CHECK(hiddenFloats < size_t{1} << 31);

  const uint64_t hiddenGradients = scratch(hiddenFloats + capacity * paddedOutputs);
  const uint64_t lastGradients = hiddenGradients + hiddenFloats * sizeof(float);
  arguments::MlpBackwardArguments arguments = {};
  arguments.samples = partArguments(options.samples);
  arguments.outputs = matrixArguments(options.output, capacity);
  arguments.outputGradients = matrixArguments(options.outputGradients, capacity);
  arguments.inputGradients = matrixArguments(options.inputGradients, capacity);
  arguments.weights = deviceAddress(options.weights);
  arguments.activations = deviceAddress(options.activations);
  arguments.firstOutputGradients = deviceAddress(options.firstOutputGradients);
  arguments.hiddenGradients = hiddenGradients;
  arguments.lastGradients = lastGradients;
  arguments.paddedInputs = shape.layerInputs(0);
  arguments.paddedOutputs = paddedOutputs;
  arguments.hiddenLayers = hiddenLayers;
  arguments.sigmoidOutput = shape.activation == OutputActivation::sigmoid;
  const Block block = blockFor(shape, std::max(width, paddedOutputs));
  if (capacity == 0) return;
  queue(kernel(kMlpBackwardSpirv, block.constants()), arguments, {groups(capacity, block.samples)});

  const GpuKernel& weightKernel = sumKernel(kMlpWeightGradientsFloatAtomicsSpirv, kMlpWeightGradientsSpirv);
  const uint32_t shares = std::clamp<uint32_t>(groups(capacity, kSamplesPerShare), 1, kMostShares);
  for (uint32_t layer = 0; layer <= hiddenLayers; ++layer) {
    arguments::MlpWeightGradientsArguments sums = {};
    sums.samples = arguments.samples;
    if (layer == 0) {
      sums.before = matrixArguments(options.input, capacity);
    } else {
      const uint64_t plane = (layer - 1) * capacity * width * sizeof(float);
      sums.before = {arguments.activations + plane, width, width, 0, 0};
    }
    sums.after = layer == hiddenLayers ? lastGradients : hiddenGradients + layer * capacity * width * sizeof(float);
    sums.gradients = deviceAddress(options.weightGradients) + shape.weightOffset(layer) * sizeof(float);
    sums.rows = shape.layerOutputs(layer);
    sums.columns = shape.layerInputs(layer);
    queue(weightKernel, sums, {groups(sums.columns, kWeightTile), groups(sums.rows, kWeightTile), shares});
  }
}

}  // namespace tessera

#include "compute/mlp.h"

#include <algorithm>
#include <bit>
#include <span>

#include "compute/vulkan/vulkan_device.h"
#include "shaders/compute/arguments_mlp.h"
#include "shaders/halve_numbers.h"
#include "shaders/mlp_backward.h"
#include "shaders/mlp_backward_emulated_matrices.h"
#include "shaders/mlp_backward_half.h"
#include "shaders/mlp_backward_matrices.h"
#include "shaders/mlp_forward.h"
#include "shaders/mlp_forward_emulated_matrices.h"
#include "shaders/mlp_forward_half.h"
#include "shaders/mlp_forward_matrices.h"
#include "shaders/mlp_largest_gradient.h"
#include "shaders/mlp_weight_gradients.h"
#include "shaders/mlp_weight_gradients_float_atomics.h"
#include "shaders/mlp_weight_gradients_half.h"
#include "shaders/mlp_weight_gradients_half_float_atomics.h"
#include "shaders/mlp_weight_gradients_matrices.h"
#include "shaders/mlp_weight_gradients_matrices_emulated.h"
#include "shaders/mlp_weight_gradients_matrices_emulated_float_atomics.h"
#include "shaders/mlp_weight_gradients_matrices_float_atomics.h"

namespace tessera {

namespace {

using Arithmetic = VulkanDevice::MlpArithmetic;
using Spirv = std::span<const uint32_t>;

constexpr uint32_t kWeightTile = 32;         // mlp_weight_gradients.comp: weights of a workgroup, squared
constexpr uint32_t kSamplesPerShare = 1024;  // samples that one workgroup there should at least sum
constexpr uint32_t kMostShares = 64;         // each weight is added to by so many workgroups at most
constexpr uint32_t kScaleGroups = 64;        // workgroups that look for the largest gradient

bool isOfMatrices(Arithmetic arithmetic) {
  return arithmetic == Arithmetic::matrices || arithmetic == Arithmetic::emulatedMatrices;
}

// In the order of Arithmetic.
Spirv chosen(Arithmetic arithmetic, Spirv floats, Spirv halves, Spirv matrices, Spirv emulatedMatrices) {
  const Spirv all[] = {floats, halves, matrices, emulatedMatrices};
  return all[static_cast<int>(arithmetic)];
}

// How a network's kernels are built: see mlp_tile.glsl and mlp_matrices.glsl.
struct Block {
  uint32_t width, samples, stateWidth;
  std::vector<uint32_t> constants() const { return {width, samples, stateWidth}; }
};

// Blocks fit in 32 KiB of shared memory.
Block blockFor(const MlpShape& shape, uint32_t stateWidth, Arithmetic arithmetic) {
  CHECK(std::has_single_bit(static_cast<uint32_t>(shape.width)));
  CHECK(16 <= shape.width);
  CHECK(shape.width <= 128);
  CHECK(shape.hiddenLayers >= 1);
  CHECK(stateWidth <= 128u);
  const uint32_t samples = (stateWidth <= 64 ? 64 : 32) * (isOfMatrices(arithmetic) ? 2 : 1);
  return {static_cast<uint32_t>(shape.width), samples, stateWidth};
}

// Places in scratch memory, each at a multiple of 16 bytes.
class Places {
 public:
  uint64_t add(size_t bytes) {
    const size_t at = bytes_;
    bytes_ += (bytes + 15) / 16 * 16;
    return at;
  }
  size_t floats() const { return bytes_ / sizeof(float); }

 private:
  size_t bytes_ = 0;
};

}  // namespace

uint64_t VulkanDevice::weightNumbers(const Slice<const float>& weights, uint64_t scratch) {
  if (!keepsHalves()) return quadAddress(weights);
  arguments::HalveNumbersArguments halve = {};
  halve.numbers = deviceAddress(weights);
  halve.halves = scratch;
  halve.count = static_cast<uint32_t>(weights.count);
  queue(kernel(kHalveNumbersSpirv), halve, {groups(weights.count, 128)});
  return scratch;
}

void VulkanDevice::enqueue(const MlpForward& options) {
  const MlpShape& shape = options.shape;
  const size_t capacity = options.samples.capacity;
  CHECK(options.input.columns == static_cast<uint32_t>(shape.inputs));
  CHECK(options.output.columns <= static_cast<uint32_t>(shape.outputs));
  CHECK(options.weights.count == shape.parameters());
  CHECK(capacity * shape.activationsPerSample() < size_t{1} << 31);
  if (capacity == 0) return;

  arguments::MlpForwardArguments arguments = {};
  arguments.samples = partArguments(options.samples);
  arguments.inputs = matrixArguments(options.input, capacity);
  arguments.outputs = matrixArguments(options.output, capacity);
  arguments.weights = weightNumbers(options.weights, keepsHalves() ? scratch(shape.parameters()) : 0);
  arguments.activations = quadAddress(options.activations);
  arguments.paddedInputs = shape.layerInputs(0);
  arguments.paddedOutputs = shape.layerOutputs(shape.hiddenLayers);
  arguments.hiddenLayers = shape.hiddenLayers;
  arguments.sigmoidOutput = shape.activation == OutputActivation::sigmoid;
  const Block block = blockFor(shape, shape.width, mlpArithmetic_);
  const Spirv spirv = chosen(mlpArithmetic_, kMlpForwardSpirv, kMlpForwardHalfSpirv, kMlpForwardMatricesSpirv,
                             kMlpForwardEmulatedMatricesSpirv);
  queue(kernel(spirv, block.constants()), arguments, {groups(capacity, block.samples)});
}

void VulkanDevice::enqueue(const MlpBackward& options) {
  const MlpShape& shape = options.shape;
  const uint32_t width = shape.width, hiddenLayers = shape.hiddenLayers;
  const uint32_t paddedOutputs = shape.layerOutputs(shape.hiddenLayers);
  const size_t capacity = options.samples.capacity;
  CHECK(options.input.columns == static_cast<uint32_t>(shape.inputs));
  CHECK(options.weights.count == shape.parameters());
  CHECK(options.weightGradients.count == shape.parameters());
  CHECK(capacity * shape.activationsPerSample() < size_t{1} << 31);
  if (capacity == 0) return;

  const size_t numberBytes = keepsHalves() ? 2 : sizeof(float);
  const size_t plane = capacity * width * numberBytes;  // of activations and gradients of one layer
  Places places;
  const uint64_t hiddenPlace = places.add(hiddenLayers * plane);
  const uint64_t lastPlace = places.add(capacity * paddedOutputs * numberBytes);
  const uint64_t weightPlace = places.add(keepsHalves() ? shape.parameters() * numberBytes : 0);
  const uint64_t largestPlace = places.add(kScaleGroups * sizeof(float));
  const uint64_t base = scratch(places.floats());

  arguments::MlpBackwardArguments arguments = {};
  arguments.last.samples = partArguments(options.samples);
  arguments.last.values = matrixArguments(options.output, capacity);
  arguments.last.gradients = matrixArguments(options.outputGradients, capacity);
  arguments.last.firstGradients = deviceAddress(options.firstOutputGradients);
  arguments.last.sigmoid = shape.activation == OutputActivation::sigmoid;
  arguments.inputGradients = matrixArguments(options.inputGradients, capacity);
  arguments.weights = weightNumbers(options.weights, base + weightPlace);
  arguments.activations = quadAddress(options.activations);
  arguments.hiddenGradients = base + hiddenPlace;
  arguments.lastGradients = base + lastPlace;
  arguments.paddedInputs = shape.layerInputs(0);
  arguments.paddedOutputs = paddedOutputs;
  arguments.hiddenLayers = hiddenLayers;
  if (keepsHalves()) {
    arguments.largest = base + largestPlace;
    arguments.largestCount = std::min(groups(capacity, 128), kScaleGroups);
    arguments::MlpLargestGradientArguments largest = {};
    largest.last = arguments.last;
    largest.largest = arguments.largest;
    queue(kernel(kMlpLargestGradientSpirv), largest, {arguments.largestCount});
  }
  const Block block = blockFor(shape, std::max(width, paddedOutputs), mlpArithmetic_);
  const Spirv spirv = chosen(mlpArithmetic_, kMlpBackwardSpirv, kMlpBackwardHalfSpirv, kMlpBackwardMatricesSpirv,
                             kMlpBackwardEmulatedMatricesSpirv);
  queue(kernel(spirv, block.constants()), arguments, {groups(capacity, block.samples)});

  for (uint32_t layer = 0; layer <= hiddenLayers; ++layer) {
    arguments::MlpWeightGradientsArguments sums = {};
    sums.samples = arguments.last.samples;
    if (layer == 0) sums.inputs = matrixArguments(options.input, capacity);
    if (layer > 0) sums.activations = arguments.activations + (layer - 1) * plane;
    sums.after = layer == hiddenLayers ? arguments.lastGradients : arguments.hiddenGradients + layer * plane;
    sums.gradients = deviceAddress(options.weightGradients) + shape.weightOffset(layer) * sizeof(float);
    sums.largest = arguments.largest;
    sums.largestCount = arguments.largestCount;
    sums.rows = shape.layerOutputs(layer);
    sums.columns = shape.layerInputs(layer);
    queueWeightGradients(sums, capacity);
  }
}

void VulkanDevice::queueWeightGradients(const arguments::MlpWeightGradientsArguments& sums, size_t capacity) {
  const uint32_t shares = std::clamp<uint32_t>(groups(capacity, kSamplesPerShare), 1, kMostShares);
  const Spirv withFloatAtomics =
      chosen(mlpArithmetic_, kMlpWeightGradientsFloatAtomicsSpirv, kMlpWeightGradientsHalfFloatAtomicsSpirv,
             kMlpWeightGradientsMatricesFloatAtomicsSpirv, kMlpWeightGradientsMatricesEmulatedFloatAtomicsSpirv);
  const Spirv without = chosen(mlpArithmetic_, kMlpWeightGradientsSpirv, kMlpWeightGradientsHalfSpirv,
                               kMlpWeightGradientsMatricesSpirv, kMlpWeightGradientsMatricesEmulatedSpirv);
  uint32_t tileRows = kWeightTile, tileColumns = kWeightTile;
  std::vector<uint32_t> constants;
  if (isOfMatrices(mlpArithmetic_)) {
    // The widest tiles that share out the rows among four subgroups and leave no column over.
    const auto tiles = [](uint32_t size, std::initializer_list<uint32_t> choices) {
      return *std::find_if(choices.begin(), choices.end(), [&](uint32_t n) { return size % (16 * n) == 0; });
    };
    constants = {tiles(sums.rows, {4, 2, 1}), tiles(sums.columns, {4, 3, 2, 1})};
    tileRows = 16 * constants[0];
    tileColumns = 16 * constants[1];
  }
  queue(sumKernel(withFloatAtomics, without, constants), sums,
        {groups(sums.columns, tileColumns), groups(sums.rows, tileRows), shares});
}

}  // namespace tessera

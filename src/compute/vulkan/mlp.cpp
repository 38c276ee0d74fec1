#include "compute/mlp.h"

#include <algorithm>
#include <bit>
#include <span>

#include "base/log.h"
#include "compute/vulkan/vulkan_device.h"
#include "shaders/compute/arguments_mlp.h"
#include "shaders/halve_numbers.h"
#include "shaders/mlp_backward.h"
#include "shaders/mlp_backward_emulated_matrices.h"
#include "shaders/mlp_backward_half.h"
#include "shaders/mlp_backward_nv_matrices.h"
#include "shaders/mlp_forward.h"
#include "shaders/mlp_forward_emulated_matrices.h"
#include "shaders/mlp_forward_half.h"
#include "shaders/mlp_forward_nv_matrices.h"
#include "shaders/mlp_largest_gradient.h"
#include "shaders/mlp_weight_gradients.h"
#include "shaders/mlp_weight_gradients_float_atomics.h"
#include "shaders/mlp_weight_gradients_half.h"
#include "shaders/mlp_weight_gradients_half_float_atomics.h"
#include "shaders/mlp_weight_gradients_matrices_emulated.h"
#include "shaders/mlp_weight_gradients_matrices_emulated_float_atomics.h"
#include "shaders/mlp_weight_gradients_matrices_nv.h"
#include "shaders/mlp_weight_gradients_matrices_nv_float_atomics.h"
#ifdef TESSERA_KHR_MATRICES
#include "shaders/mlp_backward_khr_matrices.h"
#include "shaders/mlp_forward_khr_matrices.h"
#include "shaders/mlp_weight_gradients_matrices_khr.h"
#include "shaders/mlp_weight_gradients_matrices_khr_float_atomics.h"
#endif

namespace tessera {

namespace {

constexpr uint32_t kWeightTile = 32;  // mlp_weight_gradients.comp: a workgroup sums a tile of 32 × 32 weights
// The workgroups that add to one weight, each with a share of the samples; fewer where they would wait for each other.
constexpr uint32_t kSamplesPerShare = 256, kMaxShares = 1024, kMaxSharesWithoutFloatAtomics = 64;
constexpr uint32_t kScaleGroups = 512;  // workgroups of mlp_largest_gradient.comp

#ifdef TESSERA_KHR_MATRICES
constexpr std::span<const uint32_t> kForwardByKhr = kMlpForwardKhrMatricesSpirv;
constexpr std::span<const uint32_t> kBackwardByKhr = kMlpBackwardKhrMatricesSpirv;
constexpr std::span<const uint32_t> kWeightGradientsByKhr = kMlpWeightGradientsMatricesKhrSpirv;
constexpr std::span<const uint32_t> kWeightGradientsByKhrAndFloatAtomics =
    kMlpWeightGradientsMatricesKhrFloatAtomicsSpirv;
#else  // not supported by the shader compiler
constexpr std::span<const uint32_t> kForwardByKhr, kBackwardByKhr, kWeightGradientsByKhr,
    kWeightGradientsByKhrAndFloatAtomics;
#endif

using MlpForms = VulkanDevice::MlpForms;
constexpr MlpForms kForwardForms = {kMlpForwardSpirv, kMlpForwardHalfSpirv, kMlpForwardNvMatricesSpirv, kForwardByKhr,
                                    kMlpForwardEmulatedMatricesSpirv};
constexpr MlpForms kBackwardForms = {kMlpBackwardSpirv, kMlpBackwardHalfSpirv, kMlpBackwardNvMatricesSpirv,
                                     kBackwardByKhr, kMlpBackwardEmulatedMatricesSpirv};
constexpr MlpForms kWeightGradientForms = {kMlpWeightGradientsSpirv, kMlpWeightGradientsHalfSpirv,
                                           kMlpWeightGradientsMatricesNvSpirv, kWeightGradientsByKhr,
                                           kMlpWeightGradientsMatricesEmulatedSpirv};
constexpr MlpForms kWeightGradientFormsWithFloatAtomics = {
    kMlpWeightGradientsFloatAtomicsSpirv, kMlpWeightGradientsHalfFloatAtomicsSpirv,
    kMlpWeightGradientsMatricesNvFloatAtomicsSpirv, kWeightGradientsByKhrAndFloatAtomics,
    kMlpWeightGradientsMatricesEmulatedFloatAtomicsSpirv};

// The specialization constants of a network's kernels: see mlp_tile.glsl and mlp_matrices.glsl.
struct Block {
  uint32_t width, samples, stateWidth;
  std::vector<uint32_t> constants() const { return {width, samples, stateWidth}; }
};

// Returns a block size that fits in 32 KiB of shared memory.
Block blockFor(const MlpShape& shape, uint32_t stateWidth, bool byMatrices) {
  CHECK(std::has_single_bit(static_cast<uint32_t>(shape.width)));
  CHECK(16 <= shape.width);
  CHECK(shape.width <= 128);
  CHECK(shape.hiddenLayers >= 1);
  CHECK(stateWidth <= 128u);
  const uint32_t samples = (stateWidth <= 64 ? 64 : 32) * (byMatrices ? 2 : 1);
  return {static_cast<uint32_t>(shape.width), samples, stateWidth};
}

// Suballocates scratch memory; offsets are multiples of 16 bytes.
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

std::vector<uint32_t> VulkanDevice::matrixConstants(std::vector<uint32_t> own, const GpuMatrices& matrices) {
  own.resize(3);
  own.insert(own.end(), {matrices.subgroupSize, matrices.rows, matrices.columns, matrices.depth,
                         GpuMatrices::kSubgroups * matrices.subgroupSize});
  return own;
}

const GpuKernel& VulkanDevice::mlpKernel(const MlpForms& forms, std::vector<uint32_t> constants) {
  const std::span<const uint32_t> spirv = forms[static_cast<size_t>(mlpArithmetic_)];
  CHECK(!spirv.empty());
  if (!multipliesMatrices()) return kernel(spirv, std::move(constants));
  constants = matrixConstants(std::move(constants), matrices_);
  const bool isEmulated = mlpArithmetic_ == MlpArithmetic::emulatedMatrices;
  return kernel(spirv, std::move(constants), isEmulated ? 0 : matrices_.subgroupSize);
}

template <class Make>
auto VulkanDevice::withOrWithoutMatrices(const Make& make) {
  if (multipliesMatrices()) {
    try {
      return make();
    } catch (const KernelRefused& refused) {
      warn("{} cannot compile the kernels with cooperative matrices ({}); networks run without them", name(),
           refused.reason());
      mlpArithmetic_ = MlpArithmetic::halves;  // stores activations in the same format
    }
  }
  return make();
}

VulkanDevice::BlockKernel VulkanDevice::blockKernel(const MlpForms& forms, const MlpShape& shape, uint32_t stateWidth) {
  return withOrWithoutMatrices([&]() -> BlockKernel {
    const Block block = blockFor(shape, stateWidth, multipliesMatrices());
    return {mlpKernel(forms, block.constants()), block.samples};
  });
}

uint64_t VulkanDevice::weightNumbers(const Slice<const float>& weights, uint64_t scratch) {
  if (!storesActivationsInHalf()) return quadAddress(weights);
  arguments::HalveNumbersArguments halve = {};
  halve.numbers = deviceAddress(weights);
  halve.halves = scratch;
  halve.count = static_cast<uint32_t>(weights.count);
  queue(kernel(kHalveNumbersSpirv), halve, {groups(weights.count, 128)});
  return scratch;
}

template <>
void VulkanDevice::enqueue(const MlpForward& options) {
  const MlpShape& shape = options.shape;
  const size_t capacity = options.samples.capacity;
  CHECK(options.input.columns == static_cast<uint32_t>(shape.inputs));
  CHECK(options.output.columns <= static_cast<uint32_t>(shape.outputs));
  CHECK(options.weights.count == shape.parameters());
  requireIndexable(capacity * shape.activationsPerSample());
  if (capacity == 0) return;

  arguments::MlpForwardArguments arguments = {};
  arguments.samples = partArguments(options.samples);
  arguments.inputs = matrixArguments(options.input, capacity);
  arguments.outputs = matrixArguments(options.output, capacity);
  arguments.weights = weightNumbers(options.weights, storesActivationsInHalf() ? scratch(shape.parameters()) : 0);
  arguments.activations = quadAddress(options.activations);
  arguments.paddedInputs = shape.layerInputs(0);
  arguments.paddedOutputs = shape.layerOutputs(shape.hiddenLayers);
  arguments.hiddenLayers = shape.hiddenLayers;
  arguments.sigmoidOutput = shape.activation == OutputActivation::sigmoid;
  const BlockKernel block = blockKernel(kForwardForms, shape, shape.width);
  queue(block.kernel, arguments, countGroups(options.samples, block.samples));
}

template <>
void VulkanDevice::enqueue(const MlpBackward& options) {
  const MlpShape& shape = options.shape;
  const uint32_t width = shape.width, hiddenLayers = shape.hiddenLayers;
  const uint32_t paddedOutputs = shape.layerOutputs(shape.hiddenLayers);
  const size_t capacity = options.samples.capacity;
  CHECK(options.input.columns == static_cast<uint32_t>(shape.inputs));
  CHECK(options.weights.count == shape.parameters());
  CHECK((!options.weightGradients || options.weightGradients.count == shape.parameters()));
  requireIndexable(capacity * shape.activationsPerSample());
  if (capacity == 0) return;

  const size_t numberBytes = storesActivationsInHalf() ? 2 : sizeof(float);
  const size_t plane = capacity * width * numberBytes;  // bytes of the activations or gradients of one layer
  Places places;
  const uint64_t hiddenPlace = places.add(hiddenLayers * plane);
  const uint64_t lastPlace = places.add(capacity * paddedOutputs * numberBytes);
  const uint64_t weightPlace = places.add(storesActivationsInHalf() ? shape.parameters() * numberBytes : 0);
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
  arguments.largest = noCounter_.address();
  if (storesActivationsInHalf()) {
    arguments.largest = base + largestPlace;
    arguments.largestCount = std::min(groups(capacity, 128), kScaleGroups);
    arguments::MlpLargestGradientArguments largest = {};
    largest.last = arguments.last;
    largest.largest = arguments.largest;
    queue(kernel(kMlpLargestGradientSpirv), largest, {arguments.largestCount});
  }
  const BlockKernel block = blockKernel(kBackwardForms, shape, std::max(width, paddedOutputs));
  queue(block.kernel, arguments, countGroups(options.samples, block.samples));

  for (uint32_t layer = 0; options.weightGradients && layer <= hiddenLayers; ++layer) {
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
  const bool atomics = stream_->context()->features().floatAtomics;
  const uint32_t shares =
      std::clamp<uint32_t>(groups(capacity, kSamplesPerShare), 1, atomics ? kMaxShares : kMaxSharesWithoutFloatAtomics);
  uint32_t tileRows = 0, tileColumns = 0;
  const auto make = [&]() -> const GpuKernel* {
    tileRows = tileColumns = kWeightTile;
    if (multipliesMatrices()) {
      // The largest tile that divides the matrix evenly.
      const auto largest = [](uint32_t size, std::initializer_list<uint32_t> choices) {
        return *std::find_if(choices.begin(), choices.end(), [&](uint32_t n) { return size % n == 0; });
      };
      tileRows = largest(sums.rows, {64, 32, 16});
      tileColumns = largest(sums.columns, {64, 48, 32, 16});
    }
    return &mlpKernel(atomics ? kWeightGradientFormsWithFloatAtomics : kWeightGradientForms, {tileRows, tileColumns});
  };
  const GpuKernel& kernel = *withOrWithoutMatrices(make);
  queue(kernel, sums, {groups(sums.columns, tileColumns), groups(sums.rows, tileRows), shares});
}

}  // namespace tessera

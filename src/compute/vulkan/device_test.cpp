// Tests specific to this device: both forms of the kernels that sum, every width and arithmetic of the MLP, memory that
// is allocated and freed while work is queued. All operations and shapes are tested in compute/device_test.cpp.
#include "compute/vulkan/device.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <ostream>
#include <string_view>
#include <tuple>

#include "base/error.h"
#include "base/random.h"
#include "compute/adam.h"
#include "compute/cpu/device.h"
#include "compute/hash_grid.h"
#include "compute/losses.h"
#include "compute/mlp.h"
#include "compute/reference/functions.h"
#include "gpu/testing/test_context.h"

namespace tessera {
namespace {

using reference::Doubles;

std::vector<float> randomFloats(size_t count, float low, float high, uint64_t seed) {
  const RandomStream random(seed, 1);
  std::vector<float> values(count);
  for (size_t i = 0; i < count; ++i) values[i] = low + (high - low) * random.uniform(i);
  return values;
}

std::vector<float> eighths(std::vector<float> values) {
  for (float& value : values) value = std::round(8 * value) / 8;
  return values;
}

Doubles doubles(const std::vector<float>& values) {
  return {values.begin(), values.end()};
}

// Expects every difference to be at most `tolerance` times the largest expected value.
void expectNear(const std::vector<float>& actual, const Doubles& expected, double tolerance, const char* what) {
  ASSERT_EQ(actual.size(), expected.size()) << what;
  double largest = 0, worst = 0;
  for (size_t i = 0; i < expected.size(); ++i) {
    largest = std::max(largest, std::abs(expected[i]));
    worst = std::max(worst, std::abs(actual[i] - expected[i]));
    ASSERT_TRUE(std::isfinite(actual[i])) << what << "[" << i << "]";
  }
  EXPECT_GT(largest, 0) << what;
  EXPECT_LE(worst, tolerance * largest) << what;
}

// Runs the forward and the backward pass of a network of each width, with gradients of about `gradientSize`. Inputs and
// weights are multiples of 1/8, so that the sign of a neuron's sum does not depend on rounding.
void runEveryWidth(Device& device, float gradientSize, double tolerance) {
  for (const int width : {16, 32, 64, 128}) {
    SCOPED_TRACE(width);
    // 2500 samples give several shares of the weight gradients and a partial last block. The input is wider than the
    // narrow networks, and the output is wider than 16.
    const MlpShape shape = {.inputs = 40, .width = width, .hiddenLayers = 2, .outputs = 19};
    const uint32_t samples = 2500;
    const auto input = eighths(randomFloats(samples * shape.inputs, -1, 1, 3));
    const auto weights = eighths(randomFloats(shape.parameters(), -0.3f, 0.3f, 4));
    const auto outputGradients = randomFloats(samples * shape.outputs, -gradientSize, gradientSize, 5);
    auto deviceInput = device.uploadArray(input);
    auto deviceWeights = device.uploadArray(weights);
    auto deviceOutputGradients = device.uploadArray(outputGradients);
    auto output = device.array<float>(samples * shape.outputs);
    auto activations = device.allocateActivations(shape, samples);
    auto weightGradients = device.array<float>(shape.parameters());
    auto inputGradients = device.array<float>(input.size());
    const Matrix<float> inputMatrix(deviceInput, shape.inputs), outputMatrix(output, shape.outputs);
    device.run(MlpForward{.shape = shape,
                          .samples = {samples, {}},
                          .input = inputMatrix,
                          .weights = deviceWeights.all(),
                          .output = outputMatrix,
                          .activations = activations});
    device.run(MlpBackward{.shape = shape,
                           .samples = {samples, {}},
                           .input = inputMatrix,
                           .weights = deviceWeights.all(),
                           .output = outputMatrix,
                           .activations = activations.all(),
                           .outputGradients = Matrix<float>(deviceOutputGradients, shape.outputs),
                           .firstOutputGradients = {},
                           .weightGradients = weightGradients,
                           .inputGradients = Matrix<float>(inputGradients, shape.inputs)});
    const auto forward = reference::mlpForward(shape, samples, doubles(input), doubles(weights));
    const auto backward = reference::mlpBackward(shape, samples, doubles(input), doubles(weights), forward.output,
                                                 forward.activations, doubles(outputGradients));
    expectNear(device.read(output.all()), forward.output, tolerance, "output");
    expectNear(device.read(weightGradients.all()), backward.weights, tolerance, "weight gradients");
    expectNear(device.read(inputGradients.all()), backward.input, tolerance, "input gradients");
  }
}

// Runs with hardware float atomics if the device has them, and with the fallback.
class VulkanDeviceTest : public testing::TestWithParam<bool> {
 protected:
  void SetUp() override {
    SKIP_WITHOUT_VULKAN(openForTest());
    GpuOptions options;
    options.allowed.floatAtomics = GetParam();
    options.allowed.float16 = false;
    device_ = makeVulkanDevice(options);
  }
  void TearDown() override { EXPECT_EQ(GpuContext::validationMessages(), 0); }

  std::unique_ptr<Device> device_;
};

INSTANTIATE_TEST_SUITE_P(Sums, VulkanDeviceTest, testing::Bool(), [](const testing::TestParamInfo<bool>& info) {
  return info.param ? "WithFloatAtomics" : "WithCompareAndSwap";
});

TEST_P(VulkanDeviceTest, UsesFloatAtomicsWhereAvailableAndAllowed) {
  const bool used = device_->target().find("floatAtomics") != std::string::npos;
  EXPECT_EQ(used, GetParam() && openForTest()->features().floatAtomics) << device_->target();
}

// Thousands of samples add to each of the 8 entries of the table, so lost updates show.
TEST_P(VulkanDeviceTest, LosesNoGradientWhereManySamplesMeet) {
  const HashGrid grid({.levels = 2, .features = 2, .log2TableSize = 3, .baseResolution = 2, .finestResolution = 64});
  const uint32_t samples = 5000;
  const auto positions = randomFloats(samples * 3, 0, 1, 1);
  const auto gradients = randomFloats(samples * grid.columns(), 0.5f, 1.5f, 2);
  auto devicePositions = device_->uploadArray(positions);
  auto deviceGradients = device_->uploadArray(gradients);
  auto table = device_->array<float>(grid.parameters());
  auto tableGradients = device_->array<float>(grid.parameters());
  device_->run(HashGridBackward{.grid = grid,
                                .samples = {samples, {}},
                                .positions = devicePositions.all(),
                                .table = table.all(),
                                .encodedGradients = Matrix<float>(deviceGradients, grid.columns()),
                                .tableGradients = tableGradients,
                                .positionGradients = {}});
  const auto expected = reference::hashGridBackward(grid, doubles(positions), {}, doubles(gradients));
  expectNear(device_->read(tableGradients.all()), expected.table, 1e-4, "table gradients");
}

// The capacity alone decides, so the operands are small.
TEST_P(VulkanDeviceTest, RefusesOperationsBeyondItsIndices) {
  const HashGrid grid({.levels = 2, .features = 4, .log2TableSize = 3, .baseResolution = 2, .finestResolution = 64});
  auto positions = device_->array<float>(3), encoded = device_->array<float>(grid.columns());
  auto table = device_->array<float>(grid.parameters());
  const auto encode = [&](uint32_t capacity) {
    device_->run(HashGridForward{.grid = grid,
                                 .samples = {capacity, {}},
                                 .positions = positions.all(),
                                 .table = table.all(),
                                 .encoded = Matrix<float>(encoded, grid.columns())});
  };
  encode(1);
  try {
    encode(1u << 29);
    FAIL() << "2^29 samples of 8 columns have more than 2^31 numbers";
  } catch (const Error& error) {
    EXPECT_THAT(error.reason(), testing::HasSubstr("2^31"));
    EXPECT_THAT(error.remedy(), testing::HasSubstr("samples_per_step"));
  }
}

TEST_P(VulkanDeviceTest, RunsEveryWidthOfNetworks) {
  runEveryWidth(*device_, 1, 1e-4);
}

// The last round of exchanges is full, partial or empty, and the rays fit in shared memory or not.
TEST_P(VulkanDeviceTest, ShufflesPatchesOfAnySize) {
  const std::unique_ptr<Device> cpu = makeCpuDevice(2);
  for (const uint32_t rays : {16u, 257u, 5001u, 20000u}) {
    SCOPED_TRACE(rays);
    const auto predicted = randomFloats(3 * rays, 0, 1, 21), target = randomFloats(3 * rays, 0, 1, 22);
    const auto gradientsOn = [&](Device& device) {
      auto devicePredicted = device.uploadArray(predicted), deviceTarget = device.uploadArray(target);
      auto loss = device.array<float>(1), gradients = device.array<float>(3 * rays);
      device.run(S3imLoss{.rays = {rays, {}},
                          .patches = 3,
                          .seed = 23,
                          .predicted = devicePredicted,
                          .target = deviceTarget,
                          .weights = {},
                          .loss = loss,
                          .gradients = gradients});
      return device.read(gradients.all());
    };
    expectNear(gradientsOn(*device_), doubles(gradientsOn(*cpu)), 1e-4, "gradients");
  }
}

TEST_P(VulkanDeviceTest, FreesMemoryAfterItsQueuedWork) {
  Adam adam;
  auto moments = device_->array<float>(2000);
  auto parameters = device_->array<float>(1000);
  auto counts = device_->array<uint32_t>(1000);
  adam.parameters = parameters;
  adam.firstMoments = moments.part(0, 1000);
  adam.secondMoments = moments.part(1000, 1000);
  adam.counts = counts;
  for (int i = 0; i < 200; ++i) {
    auto gradients = device_->uploadArray(std::vector<float>(1000, 1.0f));
    adam.gradients = gradients;
    device_->run(adam);
  }
  // With constant gradients, every step subtracts the learning rate.
  EXPECT_NEAR(device_->read(parameters.all())[999], -200 * adam.rate, 1e-3);
  EXPECT_EQ(device_->read(counts.all())[0], 200u);
}

TEST_P(VulkanDeviceTest, MemoryMayOutliveTheDevice) {
  auto array = device_->array<float>(100);
  device_.reset();
  EXPECT_EQ(array.size(), 100u);
}

TEST_P(VulkanDeviceTest, AllocatesZeros) {
  for (int i = 0; i < 3; ++i) {
    auto array = device_->array<uint32_t>(1001);
    EXPECT_EQ(device_->read(array.all()), std::vector<uint32_t>(1001));
    device_->write(array.all(), std::span<const uint32_t>(std::vector<uint32_t>(1001, 7u)));
  }
}

// Gradients of losses that are means over many rays are far below the range of fp16, and those of sums are far above
// it: the gradients of each network are scaled before they are converted to fp16.
struct HalfArithmetic {
  const char* name;
  std::optional<GpuMatrices> emulated = {};  // the matrices to emulate
};
void PrintTo(const HalfArithmetic& arithmetic, std::ostream* out) {
  *out << arithmetic.name;
}

class HalfNetworks : public testing::TestWithParam<std::tuple<HalfArithmetic, float>> {
 protected:
  void TearDown() override { EXPECT_EQ(GpuContext::validationMessages(), 0); }
};

std::string halfNetworkName(const testing::TestParamInfo<HalfNetworks::ParamType>& info) {
  const auto& [arithmetic, size] = info.param;
  return std::string(arithmetic.name) + (size < 1 ? "Tiny" : size > 1 ? "Huge" : "");
}

// The matrix shapes of NVIDIA and AMD GPUs, of Intel GPUs, and of Mesa's driver for the CPU.
constexpr GpuMatrices kLarge = {}, kFlat = {.rows = 8, .subgroupSize = 16},
                      kSmall = {.rows = 8, .columns = 8, .depth = 8, .subgroupSize = 8};
INSTANTIATE_TEST_SUITE_P(Networks, HalfNetworks,
                         testing::Combine(testing::Values(HalfArithmetic{"Halves"}, HalfArithmetic{"Matrices"},
                                                          HalfArithmetic{"EmulatedMatrices", kLarge},
                                                          HalfArithmetic{"EmulatedFlatMatrices", kFlat},
                                                          HalfArithmetic{"EmulatedSmallMatrices", kSmall}),
                                          testing::Values(1e-12f, 1.0f, 1e9f)),
                         halfNetworkName);

TEST_P(HalfNetworks, AreCorrectForGradientsOfAnySize) {
  const auto& [arithmetic, gradientSize] = GetParam();
  const bool byMatrices = std::string_view(arithmetic.name) == "Matrices";
  GpuOptions options;
  options.allowed.matrices = byMatrices;
  const auto context = openForTest(options);
  SKIP_WITHOUT_VULKAN(context);
  if (!context->features().float16 || context->features().matrices != byMatrices) {
    GTEST_SKIP() << context->name() << " has no such arithmetic: " << arithmetic.name;
  }
  // There are more tiles than the driver unrolls, and it confuses the tiles of different invocations across barriers.
  if (arithmetic.emulated && arithmetic.emulated->rows < 16 && context->name().find("Mesa 22.") != std::string::npos) {
    GTEST_SKIP() << context->name() << " emulates 16 x 16 matrices alone";
  }
  const std::unique_ptr<Device> device = arithmetic.emulated
                                             ? makeVulkanDeviceWithEmulatedMatrices(options, *arithmetic.emulated)
                                             : makeVulkanDevice(options);
  EXPECT_TRUE(device->storesActivationsInHalf());
  runEveryWidth(*device, gradientSize, 1e-2);
}

// During its lifetime, the driver appears not to compile kernels with cooperative matrices.
class NoMatrixKernels {
 public:
  NoMatrixKernels() {
    original() = vkCreateComputePipelines;
    vkCreateComputePipelines = [](VkDevice device, VkPipelineCache cache, uint32_t count,
                                  const VkComputePipelineCreateInfo* infos, const VkAllocationCallbacks* allocator,
                                  VkPipeline* pipelines) {
      constexpr uint32_t kConstantsOfMatrices = 8;  // VulkanDevice::matrixConstants
      const VkSpecializationInfo* constants = infos->stage.pSpecializationInfo;
      if (constants != nullptr && constants->mapEntryCount == kConstantsOfMatrices) return VK_ERROR_UNKNOWN;
      return original()(device, cache, count, infos, allocator, pipelines);
    };
  }
  ~NoMatrixKernels() { vkCreateComputePipelines = original(); }
  NoMatrixKernels(const NoMatrixKernels&) = delete;
  NoMatrixKernels& operator=(const NoMatrixKernels&) = delete;

 private:
  static PFN_vkCreateComputePipelines& original() {
    static PFN_vkCreateComputePipelines function = nullptr;
    return function;
  }
};

TEST(NetworksInHalves, FallBackIfTheDriverRejectsMatrixKernels) {
  const auto context = openForTest();
  SKIP_WITHOUT_VULKAN(context);
  if (!context->features().float16) GTEST_SKIP() << context->name() << " has no fp16";
  const NoMatrixKernels none;
  const std::unique_ptr<Device> device = makeVulkanDeviceWithEmulatedMatrices({}, kLarge);
  runEveryWidth(*device, 1, 1e-2);
}

// A step that has diverged must be visible as such, not clamped to large numbers.
TEST(NetworksInHalves, PropagateNonFiniteGradients) {
  const auto context = openForTest();
  SKIP_WITHOUT_VULKAN(context);
  if (!context->features().float16) GTEST_SKIP() << context->name() << " has no fp16";
  const MlpShape shape = {.inputs = 16, .width = 16, .hiddenLayers = 1, .outputs = 16};
  for (const bool emulated : {false, true}) {
    const std::unique_ptr<Device> device = emulated ? makeVulkanDeviceWithEmulatedMatrices({}, {}) : makeVulkanDevice();
    for (const float wrong : {NAN, INFINITY, -INFINITY}) {
      std::vector<float> upstream(16, 1.0f);
      upstream[3] = wrong;
      auto input = device->uploadArray(std::vector<float>(16, 1.0f)), output = device->array<float>(16);
      auto weights = device->uploadArray(std::vector<float>(shape.parameters(), 0.1f));
      auto weightGradients = device->array<float>(shape.parameters());
      auto outputGradients = device->uploadArray(upstream);
      auto activations = device->allocateActivations(shape, 1);
      const Matrix<float> inputMatrix(input, 16), outputMatrix(output, 16), gradientMatrix(outputGradients, 16);
      device->run(MlpForward{shape, {1, {}}, inputMatrix, weights.all(), outputMatrix, activations});
      device->run(MlpBackward{shape,
                              {1, {}},
                              inputMatrix,
                              weights.all(),
                              outputMatrix,
                              activations.all(),
                              gradientMatrix,
                              {},
                              weightGradients,
                              {}});
      const std::vector<float> gradients = device->read(weightGradients.all());
      EXPECT_FALSE(std::isfinite(gradients[0])) << wrong << ", first layer, emulated: " << emulated;
      EXPECT_FALSE(std::isfinite(gradients[shape.weightOffset(1) + 3 * shape.width])) << wrong << ", last layer";
    }
  }
}

}  // namespace
}  // namespace tessera

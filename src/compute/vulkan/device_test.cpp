// What is particular to this device: both forms of the kernels that sum, every width and arithmetic of the MLP, memory
// that comes and goes while work is queued. The walk over all operations and shapes is compute/device_test.cpp.
#include "compute/vulkan/device.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <ostream>
#include <string_view>
#include <tuple>

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

// Every difference is at most `tolerance` of the largest value.
void expectNear(const std::vector<float>& got, const Doubles& want, double tolerance, const char* what) {
  ASSERT_EQ(got.size(), want.size()) << what;
  double largest = 0, worst = 0;
  for (size_t i = 0; i < want.size(); ++i) {
    largest = std::max(largest, std::abs(want[i]));
    worst = std::max(worst, std::abs(got[i] - want[i]));
    ASSERT_TRUE(std::isfinite(got[i])) << what << "[" << i << "]";
  }
  EXPECT_GT(largest, 0) << what;
  EXPECT_LE(worst, tolerance * largest) << what;
}

// Both passes of a network of each width, with gradients of about `gradientSize`. Inputs and weights are eighths:
// whether a neuron is on does not depend on rounding.
void runEveryWidth(Device& device, float gradientSize, double tolerance) {
  for (const int width : {16, 32, 64, 128}) {
    SCOPED_TRACE(width);
    // 2500 samples: several shares of the weight gradients, and a last block that is not full. The input is wider than
    // the narrow networks, the output wider than 16.
    const MlpShape shape = {.inputs = 40, .width = width, .hiddenLayers = 2, .outputs = 19};
    const uint32_t samples = 2500;
    const auto input = eighths(randomFloats(samples * shape.inputs, -1, 1, 3));
    const auto weights = eighths(randomFloats(shape.parameters(), -0.3f, 0.3f, 4));
    const auto outputGradients = randomFloats(samples * shape.outputs, -gradientSize, gradientSize, 5);
    auto deviceInput = device.arrayOf(input);
    auto deviceWeights = device.arrayOf(weights);
    auto deviceOutputGradients = device.arrayOf(outputGradients);
    auto output = device.array<float>(samples * shape.outputs);
    auto activations = device.activationsOf(shape, samples);
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

// With hardware float atomics where there are any, and with the fallback.
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

TEST_P(VulkanDeviceTest, UsesFloatAtomicsWhereTheyAreThereAndAllowed) {
  const bool used = device_->target().find("floatAtomics") != std::string::npos;
  EXPECT_EQ(used, GetParam() && openForTest()->features().floatAtomics) << device_->target();
}

// A table of 8 entries: thousands of samples add to each, so lost updates show.
TEST_P(VulkanDeviceTest, LosesNoGradientWhereManySamplesMeet) {
  const HashGrid grid({.levels = 2, .features = 2, .log2TableSize = 3, .baseResolution = 2, .finestResolution = 64});
  const uint32_t samples = 5000;
  const auto positions = randomFloats(samples * 3, 0, 1, 1);
  const auto gradients = randomFloats(samples * grid.columns(), 0.5f, 1.5f, 2);
  auto devicePositions = device_->arrayOf(positions);
  auto deviceGradients = device_->arrayOf(gradients);
  auto table = device_->array<float>(grid.parameters());
  auto tableGradients = device_->array<float>(grid.parameters());
  device_->run(HashGridBackward{.grid = grid,
                                .samples = {samples, {}},
                                .positions = devicePositions.all(),
                                .table = table.all(),
                                .encodedGradients = Matrix<float>(deviceGradients, grid.columns()),
                                .tableGradients = tableGradients,
                                .positionGradients = {}});
  const auto want = reference::hashGridBackward(grid, doubles(positions), {}, doubles(gradients));
  expectNear(device_->read(tableGradients.all()), want.table, 1e-4, "table gradients");
}

TEST_P(VulkanDeviceTest, RunsEveryWidthOfNetworks) {
  runEveryWidth(*device_, 1, 1e-4);
}

// Whether all, some or none of a round of exchanges is left, and whether the rays fit in shared memory.
TEST_P(VulkanDeviceTest, TakesPatchesOfAnyNumberOfRays) {
  const std::unique_ptr<Device> cpu = makeCpuDevice(2);
  for (const uint32_t rays : {16u, 257u, 5001u, 20000u}) {
    SCOPED_TRACE(rays);
    const auto predicted = randomFloats(3 * rays, 0, 1, 21), target = randomFloats(3 * rays, 0, 1, 22);
    const auto gradientsOn = [&](Device& device) {
      auto there = device.arrayOf(predicted), wanted = device.arrayOf(target);
      auto loss = device.array<float>(1), gradients = device.array<float>(3 * rays);
      device.run(S3imLoss{.rays = {rays, {}},
                          .patches = 3,
                          .seed = 23,
                          .predicted = there,
                          .target = wanted,
                          .weights = {},
                          .loss = loss,
                          .gradients = gradients});
      return device.read(gradients.all());
    };
    expectNear(gradientsOn(*device_), doubles(gradientsOn(*cpu)), 1e-4, "gradients");
  }
}

TEST_P(VulkanDeviceTest, MemoryMayGoWhileWorkOnItIsQueued) {
  Adam adam;
  auto moments = device_->array<float>(2000);
  auto parameters = device_->array<float>(1000);
  auto counts = device_->array<uint32_t>(1000);
  adam.parameters = parameters;
  adam.firstMoments = moments.part(0, 1000);
  adam.secondMoments = moments.part(1000, 1000);
  adam.counts = counts;
  for (int i = 0; i < 200; ++i) {
    auto gradients = device_->arrayOf(std::vector<float>(1000, 1.0f));
    adam.gradients = gradients;
    device_->run(adam);
  }
  // Constant gradients: every step goes down by the rate.
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

// Gradients of losses that are means over many rays are far below what fp16 holds, those of sums far above: each
// network's are scaled before they become fp16.
struct HalfArithmetic {
  const char* name;
  std::optional<GpuMatrices> emulated = {};  // matrices that the device would have
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

// As of NVIDIA's and AMD's cards, of Intel's, and of Mesa's driver for the processor.
constexpr GpuMatrices kLarge = {}, kFlat = {.rows = 8, .subgroupSize = 16},
                      kSmall = {.rows = 8, .columns = 8, .depth = 8, .subgroupSize = 8};
INSTANTIATE_TEST_SUITE_P(Networks, HalfNetworks,
                         testing::Combine(testing::Values(HalfArithmetic{"Halves"}, HalfArithmetic{"Matrices"},
                                                          HalfArithmetic{"EmulatedMatrices", kLarge},
                                                          HalfArithmetic{"EmulatedFlatMatrices", kFlat},
                                                          HalfArithmetic{"EmulatedSmallMatrices", kSmall}),
                                          testing::Values(1e-12f, 1.0f, 1e9f)),
                         halfNetworkName);

TEST_P(HalfNetworks, AreRightWhateverTheSizeOfGradients) {
  const auto& [arithmetic, gradientSize] = GetParam();
  const bool byMatrices = std::string_view(arithmetic.name) == "Matrices";
  GpuOptions options;
  options.allowed.matrices = byMatrices;
  const auto context = openForTest(options);
  SKIP_WITHOUT_VULKAN(context);
  if (!context->features().float16 || context->features().matrices != byMatrices) {
    GTEST_SKIP() << context->name() << " has no such arithmetic: " << arithmetic.name;
  }
  // More tiles than it unrolls, and it mixes up what invocations keep of them while they wait for one another.
  if (arithmetic.emulated && arithmetic.emulated->rows < 16 && context->name().find("Mesa 22.") != std::string::npos) {
    GTEST_SKIP() << context->name() << " emulates 16 x 16 matrices alone";
  }
  const std::unique_ptr<Device> device = arithmetic.emulated
                                             ? makeVulkanDeviceWithEmulatedMatrices(options, *arithmetic.emulated)
                                             : makeVulkanDevice(options);
  EXPECT_TRUE(device->keepsHalves());
  runEveryWidth(*device, gradientSize, 1e-2);
}

// While it is there, the driver compiles no kernels that multiply matrices.
class NoMatrixKernels {
 public:
  NoMatrixKernels() {
    kept() = vkCreateComputePipelines;
    vkCreateComputePipelines = [](VkDevice device, VkPipelineCache cache, uint32_t count,
                                  const VkComputePipelineCreateInfo* infos, const VkAllocationCallbacks* allocator,
                                  VkPipeline* pipelines) {
      constexpr uint32_t kConstantsOfMatrices = 8;  // VulkanDevice::matrixConstants
      const VkSpecializationInfo* constants = infos->stage.pSpecializationInfo;
      if (constants != nullptr && constants->mapEntryCount == kConstantsOfMatrices) return VK_ERROR_UNKNOWN;
      return kept()(device, cache, count, infos, allocator, pipelines);
    };
  }
  ~NoMatrixKernels() { vkCreateComputePipelines = kept(); }
  NoMatrixKernels(const NoMatrixKernels&) = delete;
  NoMatrixKernels& operator=(const NoMatrixKernels&) = delete;

 private:
  static PFN_vkCreateComputePipelines& kept() {
    static PFN_vkCreateComputePipelines function = nullptr;
    return function;
  }
};

TEST(NetworksInHalves, DoWithoutMatricesWhereTheDriverCompilesNoKernelsOfThem) {
  const auto context = openForTest();
  SKIP_WITHOUT_VULKAN(context);
  if (!context->features().float16) GTEST_SKIP() << context->name() << " has no fp16";
  const NoMatrixKernels none;
  const std::unique_ptr<Device> device = makeVulkanDeviceWithEmulatedMatrices({}, kLarge);
  runEveryWidth(*device, 1, 1e-2);
}

// Where a step has gone wrong, that is seen and not made to look like large numbers.
TEST(NetworksInHalves, PassOnGradientsThatAreNoNumbers) {
  const auto context = openForTest();
  SKIP_WITHOUT_VULKAN(context);
  if (!context->features().float16) GTEST_SKIP() << context->name() << " has no fp16";
  const MlpShape shape = {.inputs = 16, .width = 16, .hiddenLayers = 1, .outputs = 16};
  for (const bool emulated : {false, true}) {
    const std::unique_ptr<Device> device = emulated ? makeVulkanDeviceWithEmulatedMatrices({}, {}) : makeVulkanDevice();
    for (const float wrong : {NAN, INFINITY, -INFINITY}) {
      std::vector<float> upstream(16, 1.0f);
      upstream[3] = wrong;
      auto input = device->arrayOf(std::vector<float>(16, 1.0f)), output = device->array<float>(16);
      auto weights = device->arrayOf(std::vector<float>(shape.parameters(), 0.1f));
      auto weightGradients = device->array<float>(shape.parameters());
      auto outputGradients = device->arrayOf(upstream);
      auto activations = device->activationsOf(shape, 1);
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
      const std::vector<float> found = device->read(weightGradients.all());
      EXPECT_FALSE(std::isfinite(found[0])) << wrong << ", first layer, emulated: " << emulated;
      EXPECT_FALSE(std::isfinite(found[shape.weightOffset(1) + 3 * shape.width])) << wrong << ", last layer";
    }
  }
}

}  // namespace
}  // namespace tessera

// What is particular to this device: both forms of the kernels that sum, every width of the MLP, memory that comes and
// goes while work is queued. The walk over all operations and shapes is compute/device_test.cpp.
#include "compute/vulkan/device.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "base/random.h"
#include "compute/reference/functions.h"
#include "gpu/test_context.h"

namespace tessera {
namespace {

using reference::Doubles;

std::vector<float> randomFloats(size_t count, float low, float high, uint64_t seed) {
  const RandomStream random(seed, 1);
  std::vector<float> values(count);
  for (size_t i = 0; i < count; ++i) values[i] = low + (high - low) * random.uniform(i);
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

// With hardware float atomics where there are any, and with the fallback.
class VulkanDeviceTest : public testing::TestWithParam<bool> {
 protected:
  void SetUp() override {
    SKIP_WITHOUT_VULKAN(openForTest());
    GpuOptions options;
    options.allowed.floatAtomics = GetParam();
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

TEST_P(VulkanDeviceTest, RunsEveryWidthForwardAndBackward) {
  for (const int width : {16, 32, 64, 128}) {
    SCOPED_TRACE(width);
    // 2500 samples: several shares of the weight gradients, and a last block that is not full. The input is wider than
    // the narrow networks, the output wider than 16.
    const MlpShape shape = {.inputs = 40, .width = width, .hiddenLayers = 2, .outputs = 19};
    const uint32_t samples = 2500;
    const auto input = randomFloats(samples * shape.inputs, -1, 1, 3);
    const auto weights = randomFloats(shape.parameters(), -0.3f, 0.3f, 4);
    const auto outputGradients = randomFloats(samples * shape.outputs, -1, 1, 5);
    auto deviceInput = device_->arrayOf(input);
    auto deviceWeights = device_->arrayOf(weights);
    auto deviceOutputGradients = device_->arrayOf(outputGradients);
    auto output = device_->array<float>(samples * shape.outputs);
    auto activations = device_->array<float>(samples * shape.activationsPerSample());
    auto weightGradients = device_->array<float>(shape.parameters());
    auto inputGradients = device_->array<float>(input.size());
    const Matrix<float> inputMatrix(deviceInput, shape.inputs), outputMatrix(output, shape.outputs);
    device_->run(MlpForward{.shape = shape,
                            .samples = {samples, {}},
                            .input = inputMatrix,
                            .weights = deviceWeights.all(),
                            .output = outputMatrix,
                            .activations = activations});
    device_->run(MlpBackward{.shape = shape,
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
    expectNear(device_->read(output.all()), forward.output, 1e-5, "output");
    expectNear(device_->read(activations.all()), forward.activations, 1e-5, "activations");
    expectNear(device_->read(weightGradients.all()), backward.weights, 1e-4, "weight gradients");
    expectNear(device_->read(inputGradients.all()), backward.input, 1e-4, "input gradients");
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

}  // namespace
}  // namespace tessera

// Properties of lookups in the virtual grid that must hold on every device, independently of the reference: a sample
// reads 20 texels of four sources and the bytes that a renderer will read, and is empty where a renderer would cull it.
#include "compute/virtual_grid.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "compute/composite.h"
#include "compute/device_test.h"

namespace tessera::device_test {
namespace {

constexpr uint32_t kWidth = VirtualGrid::kAttributes;

VirtualGrid makeGrid(uint32_t voxels, uint32_t planes) {
  VirtualGrid grid;
  grid.voxels = voxels;
  grid.planes = planes;
  return grid;
}

// Positions in [0,1]³ with a third of the coordinates at 0 or 1.
std::vector<float> places(Random& random, uint32_t count) {
  std::vector<float> positions = random.floats(size_t{3} * count, 0, 1);
  for (size_t i = 0; i < positions.size(); ++i) {
    if (random.below(3) == 0) positions[i] = static_cast<float>(random.below(2));
  }
  return positions;
}

// All texels are inside the block, so a block, or one that is merged with others, never reads outside of itself.
TEST(VirtualGrid, InterpolatesTwentyTexelsWithWeightsThatSumToOnePerSource) {
  Random random(91);
  for (const VirtualGrid& grid : {makeGrid(8, 24), makeGrid(5, 19), makeGrid(128, 512)}) {
    const uint32_t allVoxels = grid.voxels * grid.voxels * grid.voxels, ofPlane = grid.planes * grid.planes;
    const std::vector<float> positions = places(random, 500);
    for (size_t s = 0; s < positions.size(); s += 3) {
      const auto corners = reference::virtualCorners(grid, {positions[s], positions[s + 1], positions[s + 2]});
      ASSERT_EQ(corners.size(), 20u);
      for (int source = 0; source < 4; ++source) {
        const uint32_t resolution = source == 0 ? grid.voxels : grid.planes;
        const uint32_t low = source == 0 ? 0 : allVoxels + static_cast<uint32_t>(source - 1) * ofPlane;
        const size_t first = source == 0 ? 0 : static_cast<size_t>(4 + 4 * source), count = source == 0 ? 8 : 4;
        double sum = 0, middle[3] = {0, 0, 0};
        for (size_t k = first; k < first + count; ++k) {
          EXPECT_GE(corners[k].weight, 0);
          ASSERT_GE(corners[k].texel, low);
          ASSERT_LT(corners[k].texel, low + (source == 0 ? allVoxels : ofPlane));
          sum += corners[k].weight;
          for (int a = 0; a < 3; ++a) middle[a] += corners[k].weight * grid.texelPosition(corners[k].texel)[a];
        }
        EXPECT_NEAR(sum, 1, 1e-12);
        const double half = 0.5 / resolution;
        for (int a = 0; a < 3; ++a) {
          // The coordinate across a plane does not matter: the plane is evaluated at the first texel.
          const double at = a == source - 1 ? half : std::clamp<double>(positions[s + a], half, 1 - half);
          EXPECT_NEAR(middle[a], at, 1e-6) << "source " << source << ", axis " << a;
        }
      }
    }
  }
}

class VirtualGridLookup : public testing::TestWithParam<std::string> {
 protected:
  void SetUp() override {
    selectSimdTarget(GetParam());
    device = deviceNamed(GetParam());
    if (device == nullptr) GTEST_SKIP() << "this machine has no device \"" << GetParam() << "\"";
  }
  void TearDown() override { selectSimdTarget({}); }
  Device* device = nullptr;
};

struct Looked {
  std::vector<float> logDensities, colours;
};

// Lookups in one block; attributes are in the order of the rows of its texels.
class Block {
 public:
  Block(Stage& stage, const VirtualGrid& grid, const std::vector<float>& positions)
      : stage_(stage), grid_(grid), samples_(static_cast<uint32_t>(positions.size() / 3)) {
    DistinctTexels a{grid};
    a.samples = {samples_};
    blocks_ = a.blockOfSample = stage.input(std::vector<uint32_t>(samples_));
    positions_ = a.positions = stage.input(positions);
    if (grid.shareTexels) {
      a.marks = stage.outputWords("marks", grid.words());
      a.ranks = stage.outputWords("ranks", grid.words());
    }
    a.texelCapacity = samples_ * VirtualGrid::kCorners;
    a.firstTexel = stage.outputWords("firstTexel", 2);
    a.texelPositions = stage.output("texelPositions", size_t{3} * a.texelCapacity);
    stage.device.run(a);
    marks_ = a.marks;
    ranks_ = a.ranks;
    firstTexel_ = a.firstTexel;
    texels_ = stage.device.read(a.firstTexel)[1];
  }
  uint32_t texels() const { return texels_; }

  Looked look(const std::vector<float>& attributes, float minAlpha = 0, Slice<const float> runtimeSteps = {}) {
    VirtualGridForward a{grid_};
    set(a);
    a.attributes = stage_.input(attributes);
    a.minAlpha = minAlpha;
    a.runtimeSteps = runtimeSteps;
    a.logDensities = stage_.output("logDensities", samples_);
    a.colours = stage_.output("colours", size_t{kWidth - 1} * samples_);
    stage_.device.run(a);
    return {stage_.device.read(a.logDensities), stage_.device.read(a.colours)};
  }
  std::vector<float> gradients(const Looked& looked, const Looked& upstream) {
    VirtualGridBackward a{grid_};
    set(a);
    a.firstTexel = firstTexel_;
    a.logDensities = stage_.input(looked.logDensities);
    a.colours = stage_.input(looked.colours);
    a.logDensityGradients = stage_.input(upstream.logDensities);
    a.colourGradients = stage_.input(upstream.colours);
    a.attributeGradients = stage_.output("attributeGradients", size_t{kWidth} * texels_);
    stage_.device.run(a);
    return stage_.device.read(a.attributeGradients);
  }

 private:
  template <class Arguments>
  void set(Arguments& a) const {
    a.samples = {samples_};
    a.blockOfSample = blocks_;
    a.positions = positions_;
    a.marks = marks_;
    a.ranks = ranks_;
    a.texels = {texels_};
  }

  Stage& stage_;
  const VirtualGrid& grid_;
  uint32_t samples_, texels_ = 0;
  Slice<const uint32_t> blocks_, marks_, ranks_, firstTexel_;
  Slice<const float> positions_;
};

TEST_P(VirtualGridLookup, SumsAConstantOverFourSourcesBeforeTheActivation) {
  for (const VirtualGrid& grid : {makeGrid(8, 24), makeGrid(5, 19)}) {
    Stage stage(*device, 92);
    Block block(stage, grid, places(stage.random, 300));
    const float values[] = {0.6f, 0.1f, 0.3f, 0.45f, 0.5f, 0.55f, 0.7f, 0.9f};
    std::vector<float> attributes;
    for (uint32_t t = 0; t < block.texels(); ++t) attributes.insert(attributes.end(), values, values + kWidth);
    const auto byte = [&](size_t f) { return std::floor(255 * static_cast<double>(values[f]) + 0.5); };
    const Looked looked = block.look(attributes);
    for (const float logDensity : looked.logDensities) {
      ASSERT_NEAR(logDensity, 4 * (-14 + 28 * byte(0) / 255) - 1, 5e-5);
    }
    for (size_t i = 0; i < looked.colours.size(); ++i) {
      const double sum = 4 * (-7 + 14 * byte(i % 7 + 1) / 255);
      ASSERT_NEAR(looked.colours[i], 1 / (1 + std::exp(-sum)), 1e-5) << i;
    }
  }
}

TEST_P(VirtualGridLookup, QuantisesTexelsToTheNearestOf256Values) {
  const uint32_t samples = 2000;
  Stage stage(*device, 93);
  const std::vector<float> positions = places(stage.random, samples);
  std::vector<float> values = stage.random.floats(samples, 0, 1), attributes;
  values[0] = 0;
  values[1] = 1;
  for (const float value : values) attributes.insert(attributes.end(), kWidth * VirtualGrid::kCorners, value);
  for (const bool quantise : {true, false}) {
    VirtualGrid grid = makeGrid(8, 24);
    grid.featureRange = grid.densityRange = 1;  // far from where densities are clamped and colours saturate
    grid.quantise = quantise;
    grid.shareTexels = false;  // each sample has its own texels, all with the same value
    const Looked looked = Block(stage, grid, positions).look(attributes);
    double farthest = 0;
    for (uint32_t s = 0; s < samples; ++s) {
      std::vector<double> seen = {(looked.logDensities[s] + 1) / 4};
      for (size_t f = 0; f < 7; ++f) {
        const double colour = looked.colours[size_t{7} * s + f];
        seen.push_back(std::log(colour / (1 - colour)) / 4);
      }
      for (const double sum : seen) {
        const double value = (sum + 1) / 2;
        farthest = std::max(farthest, std::abs(value - values[s]));
        if (quantise) {
          EXPECT_NEAR(255 * value, std::round(255 * value), 1e-3) << values[s];
        }
      }
    }
    EXPECT_LE(farthest, (quantise ? 1 / 510.0 : 0) + 3e-6);
    if (quantise) {
      EXPECT_GE(farthest, 0.99 / 510);
    }
  }
}

TEST_P(VirtualGridLookup, PassesGradientsStraightThroughTheRounding) {
  Stage stage(*device, 94);
  VirtualGrid rounded = makeGrid(8, 24), exact = rounded;
  exact.quantise = false;
  const std::vector<float> positions = places(stage.random, 200);
  Block through(stage, rounded, positions), without(stage, exact, positions);
  const std::vector<float> attributes = stage.random.floats(size_t{kWidth} * through.texels(), 0.4f, 0.6f);
  const Looked looked = through.look(attributes);
  const Looked upstream = {stage.random.floats(200, -1, 1), stage.random.floats(1400, -1, 1)};
  const std::vector<float> gradients = through.gradients(looked, upstream);
  expectTheSameSums(gradients, without.gradients(looked, upstream));
  EXPECT_GT(*std::max_element(gradients.begin(), gradients.end()), 0.1f);
}

TEST_P(VirtualGridLookup, CullsExactlyTheSamplesWhoseRuntimeStepIsBelowMinAlpha) {
  const uint32_t samples = 2000;
  const float minAlpha = 0.005f;
  Stage stage(*device, 95);
  const VirtualGrid grid = makeGrid(8, 24);
  Block block(stage, grid, places(stage.random, samples));
  const std::vector<float> attributes = stage.random.floats(size_t{kWidth} * block.texels(), 0.35f, 0.65f);
  const std::vector<float> steps = stage.random.floats(samples, 0, 0.1f);
  const Looked all = block.look(attributes), seen = block.look(attributes, minAlpha, stage.input(steps));
  EXPECT_EQ(seen.colours, all.colours);
  int culled = 0, visible = 0;
  for (uint32_t s = 0; s < samples; ++s) {
    const double alpha = -std::expm1(-std::exp(static_cast<double>(all.logDensities[s])) * steps[s]);
    if (std::abs(alpha - minAlpha) < 1e-5 * minAlpha) continue;  // rounding may decide either way
    EXPECT_EQ(seen.logDensities[s], alpha < minAlpha ? VirtualGrid::kCulled : all.logDensities[s]) << alpha;
    ++(alpha < minAlpha ? culled : visible);
  }
  EXPECT_GT(culled, 200);
  EXPECT_GT(visible, 200);
  // A culled sample has weight zero for any step length.
  CompositeForward a;
  a.minTransmittance = 0;
  a.rays.capacity = samples;
  std::vector<uint32_t> first(samples + 1);
  for (uint32_t s = 0; s <= samples; ++s) first[s] = s;
  a.firstSample = stage.input(first);
  a.x = stage.makeMatrix(seen.logDensities, 1, Layout::plain);
  a.steps = stage.randomInput(samples, 1, 1e6f);
  a.opacity = stage.output("opacity", samples);
  a.weights = stage.output("weights", samples);
  device->run(a);
  const std::vector<float> opacity = device->read(a.opacity);
  for (uint32_t s = 0; s < samples; ++s) EXPECT_EQ(opacity[s] == 0, seen.logDensities[s] == VirtualGrid::kCulled) << s;
}

INSTANTIATE_TEST_SUITE_P(Devices, VirtualGridLookup, testing::ValuesIn(deviceNames()), [](const auto& info) {
  std::string name = info.param;
  std::replace(name.begin(), name.end(), ' ', '_');
  return name;
});

}  // namespace
}  // namespace tessera::device_test

// Properties that must hold on every device, independently of the reference.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "compute/adam.h"
#include "compute/composite.h"
#include "compute/device_test.h"
#include "compute/occupancy.h"
#include "compute/octahedra.h"
#include "compute/rays.h"

namespace tessera::device_test {
namespace {

class DeviceProperties : public testing::TestWithParam<std::string> {
 protected:
  void SetUp() override {
    selectSimdTarget(GetParam());
    device = deviceNamed(GetParam());
    if (device == nullptr) GTEST_SKIP() << "this machine has no device \"" << GetParam() << "\"";
  }
  void TearDown() override { selectSimdTarget({}); }
  Device* device = nullptr;
};

TEST_P(DeviceProperties, MemoryStartsZeroedAndKeepsWhatIsWritten) {
  Array<float> array = device->array<float>(1001);
  for (float value : device->read(array.all())) ASSERT_EQ(value, 0.0f);
  const std::vector<float> written = {1, 2, 3};
  device->write(array.part(500, 3), std::span<const float>(written));
  EXPECT_EQ(device->read(array.part(499, 5)), (std::vector<float>{0, 1, 2, 3, 0}));
  device->fillZero(array.part(501, 1));
  EXPECT_EQ(device->read(array.part(499, 5)), (std::vector<float>{0, 1, 0, 3, 0}));
}

TEST_P(DeviceProperties, OpacityIsTheSumOfWeights) {
  Stage stage(*device, 71);
  const uint32_t rays = 50;
  const std::vector<uint32_t> first = stage.random.firstSamples(rays, 60);
  CompositeForward a;
  a.rays.capacity = rays;
  a.firstSample = stage.input(first);
  a.x = stage.randomMatrix(first.back(), 1, Layout::plain, -3, 4);
  a.steps = stage.randomInput(first.back(), 0.01f, 0.1f);
  a.distances = stage.randomInput(first.back(), 0, 1);
  a.colours = stage.randomMatrix(first.back(), 3, Layout::plain, 1, 1);
  a.background = stage.input(std::vector<float>(3 * rays, 1.0f));
  a.colour = stage.output("colour", 3 * rays);
  a.opacity = stage.output("opacity", rays);
  a.depth = stage.output("depth", rays);
  a.weights = stage.output("weights", first.back());
  device->run(a);
  const std::vector<float> weights = device->read(a.weights), opacity = device->read(a.opacity);
  for (float channel : device->read(a.colour)) EXPECT_NEAR(channel, 1, 2e-6) << "white before white is white";
  for (uint32_t ray = 0; ray < rays; ++ray) {
    double sum = 0;
    for (uint32_t i = first[ray]; i < first[ray + 1]; ++i) sum += weights[i];
    EXPECT_NEAR(opacity[ray], sum, 2e-6) << "ray " << ray;
  }
}

// UE4-NeRF: the two losses compare with the same image where the second excludes nothing.
TEST_P(DeviceProperties, OpaqueImageIsTheCompositeByItsOpacityWhereNothingIsExcluded) {
  Stage stage(*device, 72);
  const uint32_t rays = 50;
  const std::vector<uint32_t> first = stage.random.firstSamples(rays, 20);
  CompositeForward all;
  all.extinction = Extinction::logit;
  all.rays.capacity = rays;
  all.firstSample = stage.input(first);
  all.x = stage.randomMatrix(first.back(), 1, Layout::plain, -4, -3);  // so faint that no ray ends early
  all.offset = -0.5f;
  all.colours = stage.randomMatrix(first.back(), 3, Layout::plain, 0, 1);
  all.colour = stage.output("colour", 3 * rays);
  all.opacity = stage.output("opacity", rays);
  all.weights = stage.output("weights", first.back());
  device->run(all);
  OpaqueForward opaque;
  opaque.offset = all.offset;
  opaque.rays = all.rays;
  opaque.firstSample = all.firstSample;
  opaque.x = all.x;
  opaque.colours = all.colours;
  opaque.colour = stage.output("opaqueColour", 3 * rays);
  opaque.opacity = stage.output("opaqueOpacity", rays);
  device->run(opaque);
  const std::vector<float> colour = device->read(all.colour), opacity = device->read(all.opacity);
  const std::vector<float> divided = device->read(opaque.colour), same = device->read(opaque.opacity);
  int compared = 0;
  for (uint32_t ray = 0; ray < rays; ++ray) {
    if (opacity[ray] < 0.01f) continue;
    ++compared;
    EXPECT_LT(opacity[ray], opaque.maxOpacity);
    EXPECT_NEAR(same[ray], opacity[ray], 2e-6) << "ray " << ray;
    for (uint32_t c = 0; c < 3; ++c)
      EXPECT_NEAR(divided[3 * ray + c], colour[3 * ray + c] / opacity[ray], 2e-4) << "ray " << ray;
  }
  EXPECT_GT(compared, 20);
}

// The normalised image has the colour's gradient, divided among the samples by their weights, and how opaque a ray is
// as a whole makes no difference to it: Σ w (c - C) = 0, and samples of one colour have no gradients of opacity.
TEST_P(DeviceProperties, OpaqueImageGivesTheOpacityOfARayNoGradient) {
  Stage stage(*device, 73);
  const uint32_t rays = 50;
  const std::vector<uint32_t> first = stage.random.firstSamples(rays, 20);
  OpaqueForward forward;
  forward.threshold = 0.3f;
  forward.rays.capacity = rays;
  forward.firstSample = stage.input(first);
  forward.x = stage.randomMatrix(first.back(), 1, Layout::plain, -3, 3);
  forward.opacity = stage.output("opacity", rays);
  const Slice<const float> gradients = stage.randomInput(3 * rays, -1, 1);
  const auto backward = [&](Matrix<const float> colours, const std::string& name) {
    forward.colours = colours;
    forward.colour = stage.output(name + "Colour", 3 * rays);
    device->run(forward);
    OpaqueBackward a;
    a.threshold = forward.threshold;
    a.rays = forward.rays;
    a.firstSample = forward.firstSample;
    a.x = forward.x;
    a.colours = colours;
    a.colour = forward.colour;
    a.rayColourGradients = gradients;
    a.xGradients = stage.output(name + "XGradients", first.back());
    a.colourGradients = stage.outputMatrix(name + "ColourGradients", first.back(), 3, Layout::plain);
    device->fillZero(a.xGradients);
    device->fillZero(a.colourGradients.data);
    device->run(a);
    return a;
  };
  const OpaqueBackward grey = backward(stage.randomMatrix(first.back(), 3, Layout::plain, 0.5f, 0.5f), "grey");
  for (const float gradient : device->read(grey.xGradients)) EXPECT_NEAR(gradient, 0, 1e-6);
  const OpaqueBackward a = backward(stage.randomMatrix(first.back(), 3, Layout::plain, 0, 1), "random");
  const std::vector<float> colours = device->read(a.colours.data), image = device->read(a.colour);
  const std::vector<float> colourGradients = device->read(a.colourGradients.data), ofImage = device->read(gradients);
  const std::vector<float> opacity = device->read(forward.opacity);
  int compared = 0;
  for (uint32_t ray = 0; ray < rays; ++ray) {
    if (opacity[ray] == 0) continue;
    ++compared;
    double across = 0;
    for (uint32_t c = 0; c < 3; ++c) {
      double sum = 0;
      for (uint32_t i = first[ray]; i < first[ray + 1]; ++i) {
        sum += colourGradients[3 * i + c];
        across += colourGradients[3 * i + c] * (colours[3 * i + c] - image[3 * ray + c]);
      }
      EXPECT_NEAR(sum, ofImage[3 * ray + c], 2e-6) << "ray " << ray;
    }
    EXPECT_NEAR(across, 0, 2e-6) << "ray " << ray;
  }
  EXPECT_GT(compared, 20);
}

TEST_P(DeviceProperties, MarchingInRoundsMakesTheSamplesOfOneMarch) {
  Stage stage(*device, 74);
  const uint32_t rays = 50, capacity = 20000;
  const MarchSpace space{.contracted = true, .gridResolution = 16, .far = 50, .minStep = 0.02f, .cone = 1.0f / 64};
  std::vector<uint32_t> bits(16 * 16 * 16 / 32);
  for (uint32_t& word : bits) word = stage.random.bits();
  MarchRays march{space};
  march.rays.capacity = rays;
  march.sampleCapacity = capacity;
  march.origins = stage.input(stage.random.floats(3 * rays, -1.5f, 1.5f));
  march.directions = stage.input(stage.random.directions(rays));
  march.jitter = stage.randomInput(rays, 0, 1);
  march.occupancy = stage.input(bits);
  march.firstSample = stage.outputWords("firstSample", rays + 1);
  march.sampleCount = stage.outputWords("sampleCount", 1);
  march.positions = stage.output("positions", 3 * capacity);
  march.distances = stage.output("distances", capacity);
  march.steps = stage.output("steps", capacity);
  std::vector<std::vector<float>> whole(rays), pieces(rays);
  const auto collect = [&](std::vector<std::vector<float>>& samples) {
    device->run(march);
    const std::vector<uint32_t> first = device->read(march.firstSample);
    const std::vector<float> distances = device->read(march.distances);
    for (uint32_t ray = 0; ray < rays; ++ray) {
      samples[ray].insert(samples[ray].end(), distances.begin() + first[ray], distances.begin() + first[ray + 1]);
    }
  };
  collect(whole);
  march.nextStep = stage.input(std::vector<uint32_t>(rays));
  for (const uint32_t maximum : {1u, 7u, 16u, 3u, 0xffffffffu}) {
    march.maximum = maximum;
    collect(pieces);
  }
  EXPECT_EQ(whole, pieces);
  for (const uint32_t next : device->read(march.nextStep)) EXPECT_EQ(next, MarchRays::kThrough);
}

TEST_P(DeviceProperties, CompactionKeepsAllSamplesThatCompositingWeighs) {
  Stage stage(*device, 72);
  const uint32_t rays = 40;
  const std::vector<uint32_t> first = stage.random.firstSamples(rays, 60);
  CompositeForward a;
  a.rays.capacity = rays;
  a.firstSample = stage.input(first);
  a.x = stage.randomMatrix(first.back(), 1, Layout::plain, -1, 6);
  a.steps = stage.randomInput(first.back(), 0.01f, 0.1f);
  a.distances = stage.randomInput(first.back(), 0, 1);
  a.colours = stage.randomMatrix(first.back(), 3, Layout::plain, 0, 1);
  a.colour = stage.output("colour", 3 * rays);
  a.opacity = stage.output("opacity", rays);
  a.depth = stage.output("depth", rays);
  a.weights = stage.output("weights", first.back());
  device->run(a);
  CompactSamples c;
  c.rays.capacity = rays;
  c.sampleCapacity = c.keptCapacity = first.back();
  c.maxOpticalDepth = -std::log(a.minTransmittance);
  c.firstSample = a.firstSample;
  c.logDensity = a.x;
  c.steps = a.steps;
  c.keptFirstSample = stage.outputWords("keptFirstSample", rays + 1);
  c.keptCount = stage.outputWords("keptCount", 1);
  c.source = stage.outputWords("source", first.back());
  c.rayOfSample = stage.outputWords("rayOfSample", first.back());
  device->run(c);
  const std::vector<uint32_t> source = device->read(c.source);
  const uint32_t keptSamples = device->read(c.keptCount)[0];
  EXPECT_LT(keptSamples, first.back());
  std::vector<bool> isKept(first.back());
  for (uint32_t i = 0; i < keptSamples; ++i) isKept[source[i]] = true;
  const std::vector<float> weights = device->read(a.weights);
  for (uint32_t i = 0; i < first.back(); ++i) EXPECT_EQ(isKept[i], weights[i] > 0) << i;
}

TEST_P(DeviceProperties, OccupancyForgetsWhatIsEmptyAndKeepsWhatIsFull) {
  Stage stage(*device, 73);
  const MarchSpace space{.contracted = false, .gridResolution = 8, .minStep = 0.01f, .cone = 0};
  const uint32_t all = 512;
  const Slice<float> grid = stage.input(std::vector<float>(all, 1.0f));
  const Slice<uint32_t> bits = stage.input(std::vector<uint32_t>(all / 32, ~0u));
  const Slice<uint32_t> cells = stage.input(std::vector<uint32_t>(all));
  const Slice<float> positions = stage.input(std::vector<float>(3 * all));
  const Slice<float> densities = stage.input(std::vector<float>(all));
  int updates = 0, lastChange = 0;
  std::vector<uint32_t> before(all / 32, ~0u);
  for (; updates < 150; ++updates) {
    device->run(OccupancyPoints{space, all, 0, static_cast<uint64_t>(updates), {}, bits, cells, positions});
    std::vector<float> logDensity;  // a wall at x < 1/4 with an optical thickness of 0.05 per step; empty beyond
    const std::vector<float> at = device->read(positions);
    for (uint32_t i = 0; i < all; ++i) logDensity.push_back(at[3 * i] < 0.25f ? std::log(5.0f) : -30.0f);
    device->write(densities, std::span<const float>(logDensity));
    device->run(OccupancyUpdate{space, all, 0.95f, 0.01f, cells, Matrix<float>(densities, 1), grid, bits});
    const std::vector<uint32_t> now = device->read(bits);
    if (now != before) lastChange = updates;
    before = now;
  }
  // 0.95^n < 0.01 from n = 90 on; the mean stays above 0.01 until then.
  EXPECT_NEAR(lastChange, 89, 1);
  for (uint32_t cell = 0; cell < all; ++cell) EXPECT_EQ(before[cell / 32] >> cell % 32 & 1, cell % 8 < 2 ? 1u : 0u);
}

// Among transparent cells one opaque child at a time, at every place that it can have in its parent.
TEST_P(DeviceProperties, CoarserOctahedraTakeTheVertexOfTheOpaqueChild) {
  constexpr uint32_t kFine = 8, kCoarse = kFine / 2;
  for (uint32_t child = 0; child < 8; ++child) {
    Stage stage(*device, 81 + child);
    const std::array<uint32_t, 3> parent = {1, 3, 2};
    std::array<uint32_t, 3> cell{};
    for (uint32_t axis = 0; axis < 3; ++axis) cell[axis] = 2 * parent[axis] + (child >> axis & 1);
    const uint32_t planted = cell[0] + kFine * (cell[1] + kFine * cell[2]), cells = kFine * kFine * kFine;
    std::vector<uint32_t> all(cells);
    std::vector<float> logits(cells, -2), displacements(size_t{3} * cells);
    for (uint32_t i = 0; i < cells; ++i) all[i] = i;
    logits[planted] = 3;
    for (float& displacement : displacements) displacement = stage.random.uniform(-0.45f, 0.45f);
    MergeOctahedra merge;
    merge.resolution = kFine;
    merge.cells = stage.input(all);
    merge.x = stage.makeMatrix(logits, 1, Layout::plain);
    merge.displacements = stage.input(displacements);
    merge.opacities = stage.output("opacities", cells);
    merge.mergedDisplacements = stage.output("mergedDisplacements", size_t{3} * cells / 8);
    device->run(merge);
    const std::vector<float> merged = device->read(merge.mergedDisplacements);
    const size_t at = parent[0] + kCoarse * (parent[1] + size_t{kCoarse} * parent[2]);
    for (size_t axis = 0; axis < 3; ++axis) {
      const double fine = cell[axis] + 0.5 + displacements[size_t{3} * planted + axis];
      EXPECT_NEAR(2 * (static_cast<double>(parent[axis]) + 0.5 + merged[3 * at + axis]), fine, 1e-5)
          << "child " << child << ", axis " << axis;
    }
    for (const float displacement : merged) EXPECT_LE(std::abs(displacement), 0.5f) << "within the cell";
  }
}

TEST_P(DeviceProperties, AdamCountsTheStepsOfEachParameterAndLeavesTheUntouchedAlone) {
  Stage stage(*device, 74);
  const size_t n = 101;
  std::vector<float> parameters = stage.random.floats(n, -1, 1);
  Adam a;
  a.skipZeroGradients = true;
  a.parameters = stage.input(parameters);
  a.gradients = stage.input(std::vector<float>(n));
  a.firstMoments = stage.input(std::vector<float>(n));
  a.secondMoments = stage.input(std::vector<float>(n));
  a.counts = stage.input(std::vector<uint32_t>(n));
  Doubles theta = toDoubles(parameters), m(n), v(n);
  std::vector<uint32_t> counts(n);
  for (int step = 0; step < 20; ++step) {
    std::vector<float> gradients(n);
    for (size_t i = 0; i < n; ++i) {
      // Some parameters never have a gradient; all others have one in two of three steps.
      if (i % 10 == 9 || (i + step) % 3 == 0) continue;
      const double g = gradients[i] = stage.random.uniform(0.1f, 1) * (stage.random.below(2) ? 1e-6f : 1.0f);
      m[i] = 0.9 * m[i] + 0.1 * g;
      v[i] = 0.99 * v[i] + 0.01 * g * g;
      ++counts[i];
      const double unbiased = std::sqrt(1 - std::pow(0.99, counts[i])) / (1 - std::pow(0.9, counts[i]));
      theta[i] -= 1e-2 * unbiased * m[i] / (std::sqrt(v[i]) + 1e-15);
    }
    device->write(a.gradients, std::span<const float>(gradients));
    device->run(a);
    for (float gradient : device->read(a.gradients)) ASSERT_EQ(gradient, 0.0f);
  }
  EXPECT_EQ(device->read(a.counts), counts);
  const std::vector<float> result = device->read(a.parameters);
  for (size_t i = 0; i < n; ++i) {
    EXPECT_NEAR(result[i], theta[i], 1e-5) << i;
    if (i % 10 == 9) {
      EXPECT_EQ(result[i], parameters[i]);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Devices, DeviceProperties, testing::ValuesIn(deviceNames()), [](const auto& info) {
  std::string name = info.param;
  std::replace(name.begin(), name.end(), ' ', '_');
  return name;
});

}  // namespace
}  // namespace tessera::device_test

// Properties of compositing by blocks that must hold on every device: it gives the same image as one global volume
// (City-on-Web, eq. 8 to 11), and the losses pull in the intended direction.
#include "compute/deferred.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "compute/blend.h"
#include "compute/composite.h"
#include "compute/device_test.h"
#include "compute/losses.h"

namespace tessera::device_test {
namespace {

class Blocks : public testing::TestWithParam<std::string> {
 protected:
  void SetUp() override {
    selectSimdTarget(GetParam());
    device = deviceNamed(GetParam());
    if (device == nullptr) GTEST_SKIP() << "this machine has no device \"" << GetParam() << "\"";
  }
  void TearDown() override { selectSimdTarget({}); }

  // Allows for rounding to float, and for sums that are added in a different order.
  double tolerance() const { return GetParam() == "reference" ? 1e-6 : 1e-5; }
  void expectNear(const std::vector<float>& actual, const std::vector<float>& expected) const {
    ASSERT_EQ(actual.size(), expected.size());
    for (size_t i = 0; i < expected.size(); ++i) EXPECT_NEAR(actual[i], expected[i], tolerance()) << i;
  }

  Device* device = nullptr;
};

// Rays of samples with an opacity and 7 columns, cut into segments at random places.
struct Volume {
  std::vector<uint32_t> firstSample, firstSegment, firstSampleOfSegment;
  std::vector<float> alpha, distances, columns;
  uint32_t rays() const { return static_cast<uint32_t>(firstSample.size()) - 1; }
  uint32_t segments() const { return firstSegment.back(); }
  uint32_t samples() const { return firstSample.back(); }
};

Volume randomVolume(Random& random) {
  Volume volume;
  volume.firstSample = random.firstSamples(60, 30);
  volume.alpha = random.floats(volume.samples(), 0, 0.6f);
  volume.distances = random.floats(volume.samples(), 0, 1);
  volume.columns = random.floats(7 * volume.samples(), 0, 1);
  volume.firstSegment = {0};
  for (uint32_t ray = 0; ray < volume.rays(); ++ray) {
    const uint32_t last = volume.firstSample[ray + 1];
    volume.firstSampleOfSegment.push_back(volume.firstSample[ray]);
    while (random.below(3) > 0) {  // segments may be empty
      const uint32_t from = volume.firstSampleOfSegment.back();
      volume.firstSampleOfSegment.push_back(from + random.below(last - from + 1));
    }
    volume.firstSegment.push_back(static_cast<uint32_t>(volume.firstSampleOfSegment.size()));
  }
  volume.firstSampleOfSegment.push_back(volume.samples());
  return volume;
}

// A worked example with given α and c, in blocks of two, two and one samples.
Volume exampleVolume() {
  Volume volume;
  volume.firstSample = {0, 5};
  volume.firstSegment = {0, 3};
  volume.firstSampleOfSegment = {0, 2, 4, 5};
  volume.alpha = {.1f, .3f, .2f, .5f, .25f};
  volume.distances = {1, 2, 3, 4, 5};
  for (const float c : {.9f, .2f, .5f, .7f, .1f}) volume.columns.insert(volume.columns.end(), 7, c);
  return volume;
}

struct Composited {
  Slice<float> colour, opacity, depth, weights;
};

// Composites each ray as one volume, or each segment if `firstSample` is that of the segments.
Composited composite(Stage& stage, const Volume& volume, const std::vector<uint32_t>& firstSample) {
  const uint32_t rays = static_cast<uint32_t>(firstSample.size()) - 1;
  CompositeForward a;
  a.extinction = Extinction::opacity;
  a.minTransmittance = 0;
  a.rays.capacity = rays;
  a.firstSample = stage.input(firstSample);
  a.x = stage.makeMatrix(volume.alpha, 1, Layout::plain);
  a.distances = stage.input(volume.distances);
  a.colours = stage.makeMatrix(volume.columns, 7, Layout::plain);
  a.colour = stage.output("colour", 7 * rays);
  a.opacity = stage.output("opacity", rays);
  a.depth = stage.output("depth", rays);
  a.weights = stage.output("weights", volume.samples());
  stage.device.run(a);
  return {a.colour, a.opacity, a.depth, a.weights};
}

struct Gradients {
  std::vector<float> x, columns;
};

// Gradients for given gradients of the composited columns and of the opacity of each ray.
Gradients compositeBackward(Stage& stage, const Volume& volume, const std::vector<uint32_t>& firstSample,
                            Slice<const float> colourGradients, Slice<const float> opacityGradients) {
  CompositeBackward a;
  a.extinction = Extinction::opacity;
  a.minTransmittance = 0;
  a.rays.capacity = static_cast<uint32_t>(firstSample.size()) - 1;
  a.firstSample = stage.input(firstSample);
  a.x = stage.makeMatrix(volume.alpha, 1, Layout::plain);
  a.colours = stage.makeMatrix(volume.columns, 7, Layout::plain);
  a.rayColourGradients = colourGradients;
  a.rayOpacityGradients = opacityGradients;
  a.xGradients = stage.output("xGradients", volume.samples());
  a.colourGradients = stage.outputMatrix("colourGradients", volume.samples(), 7, Layout::plain);
  stage.device.run(a);
  return {stage.device.read(a.xGradients), stage.device.read(a.colourGradients.data)};
}

struct Segments {
  std::vector<uint32_t> first;
  std::vector<float> composited, specular, opacities, depths;
};

struct Picture {
  std::vector<float> colour, opacity, depth;
};

Picture blend(Stage& stage, const Segments& segments, bool literal = false) {
  const uint32_t rays = static_cast<uint32_t>(segments.first.size()) - 1;
  BlendForward a;
  a.literal = literal;
  a.rays.capacity = rays;
  a.firstSegment = stage.input(segments.first);
  a.composited = stage.input(segments.composited);
  a.specular = stage.input(segments.specular);
  a.opacities = stage.input(segments.opacities);
  a.depths = stage.input(segments.depths);
  a.colour = stage.output("colour", 3 * rays);
  a.opacity = stage.output("opacity", rays);
  a.depth = stage.output("depth", rays);
  stage.device.run(a);
  return {stage.device.read(a.colour), stage.device.read(a.opacity), stage.device.read(a.depth)};
}

Segments compositeSegments(Stage& stage, const Volume& volume) {
  const Composited c = composite(stage, volume, volume.firstSampleOfSegment);
  return {volume.firstSegment, stage.device.read(c.colour), std::vector<float>(3 * volume.segments()),
          stage.device.read(c.opacity), stage.device.read(c.depth)};
}

Segments randomSegments(Random& random, uint32_t rays) {
  Segments segments;
  segments.first = random.firstSamples(rays, 6);
  const size_t count = segments.first.back();
  segments.composited = random.floats(7 * count, 0, 1);
  segments.specular = random.floats(3 * count, 0, 1);
  segments.opacities = random.floats(count, 0, 1);
  segments.depths = random.floats(count, 0, 5);
  return segments;
}

std::vector<float> firstThreeOfSeven(const std::vector<float>& rows) {
  std::vector<float> values;
  for (size_t i = 0; i < rows.size(); ++i)
    if (i % 7 < 3) values.push_back(rows[i]);
  return values;
}

TEST_P(Blocks, MatchTheWorkedExample) {
  Stage stage(*device, 81);
  const Volume volume = exampleVolume();
  const Segments segments = compositeSegments(stage, volume);
  const float colours[] = {.144f, .38f, .025f}, opacities[] = {.37f, .6f, .25f};
  for (size_t k = 0; k < 3; ++k) {
    EXPECT_NEAR(segments.composited[7 * k], colours[k], tolerance()) << k;
    EXPECT_NEAR(segments.opacities[k], opacities[k], tolerance()) << k;
  }
  const Picture picture = blend(stage, segments);
  for (float channel : picture.colour) EXPECT_NEAR(channel, .3897, tolerance());
  EXPECT_NEAR(picture.opacity[0], .811, tolerance());
}

TEST_P(Blocks, CompositeLikeOneVolumeWithoutSpecularColour) {
  Stage stage(*device, 82);
  const Volume volume = randomVolume(stage.random);
  ASSERT_GT(volume.segments(), volume.rays() + 20);
  const Composited whole = composite(stage, volume, volume.firstSample);
  for (bool literal : {false, true}) {
    const Picture picture = blend(stage, compositeSegments(stage, volume), literal);
    expectNear(picture.colour, firstThreeOfSeven(device->read(whole.colour)));
    expectNear(picture.opacity, device->read(whole.opacity));
    expectNear(picture.depth, device->read(whole.depth));
  }
}

TEST_P(Blocks, HaveTheGradientsOfOneVolumeWithoutSpecularColour) {
  Stage stage(*device, 83);
  const Volume volume = randomVolume(stage.random);
  const Segments segments = compositeSegments(stage, volume);
  const std::vector<float> colour = stage.random.floats(3 * volume.rays(), -1, 1);
  const Slice<float> opacity = stage.randomInput(volume.rays(), -1, 1);
  std::vector<float> wide(7 * volume.rays());
  for (size_t i = 0; i < colour.size(); ++i) wide[i / 3 * 7 + i % 3] = colour[i];
  const Gradients whole = compositeBackward(stage, volume, volume.firstSample, stage.input(wide), opacity);

  BlendBackward a;
  a.rays.capacity = volume.rays();
  a.firstSegment = stage.input(segments.first);
  a.composited = stage.input(segments.composited);
  a.specular = stage.input(segments.specular);
  a.opacities = stage.input(segments.opacities);
  a.rayColourGradients = stage.input(colour);
  a.rayOpacityGradients = opacity;
  a.compositedGradients = stage.output("compositedGradients", segments.composited.size());
  a.specularGradients = stage.output("specularGradients", segments.specular.size());
  a.opacityGradients = stage.output("opacityGradients", segments.opacities.size());
  device->run(a);
  const Gradients parts =
      compositeBackward(stage, volume, volume.firstSampleOfSegment, a.compositedGradients, a.opacityGradients);
  expectNear(parts.x, whole.x);
  expectNear(parts.columns, whole.columns);
}

TEST_P(Blocks, ContributeNothingIfEmpty) {
  Stage stage(*device, 84);
  const Segments segments = randomSegments(stage.random, 50);
  Segments more;
  more.first = {0};
  const auto add = [&](uint32_t k) {
    more.composited.insert(more.composited.end(), &segments.composited[7 * k], &segments.composited[7 * k] + 7);
    more.specular.insert(more.specular.end(), &segments.specular[3 * k], &segments.specular[3 * k] + 3);
    more.opacities.push_back(segments.opacities[k]);
    more.depths.push_back(segments.depths[k]);
  };
  const auto addEmpty = [&] {
    more.composited.insert(more.composited.end(), 7, 0.0f);
    for (float channel : stage.random.floats(3, 0.5f, 1)) more.specular.push_back(channel);
    more.opacities.push_back(0);
    more.depths.push_back(0);
  };
  for (uint32_t ray = 0; ray < 50; ++ray) {
    if (stage.random.below(2)) addEmpty();
    for (uint32_t k = segments.first[ray]; k < segments.first[ray + 1]; ++k) {
      add(k);
      if (stage.random.below(2)) addEmpty();
    }
    more.first.push_back(static_cast<uint32_t>(more.opacities.size()));
  }
  ASSERT_GT(more.opacities.size(), segments.opacities.size() + 20);
  const Picture without = blend(stage, segments), with = blend(stage, more);
  EXPECT_EQ(with.colour, without.colour);
  EXPECT_EQ(with.opacity, without.opacity);
  EXPECT_EQ(with.depth, without.depth);
  EXPECT_NE(blend(stage, more, true).colour, blend(stage, segments, true).colour)
      << "with the printed equation they contribute";
}

TEST_P(Blocks, BlendToTheSameImageBackToFront) {
  Stage stage(*device, 85);
  const uint32_t rays = 50;
  const Segments segments = randomSegments(stage.random, rays);
  std::vector<float> colour(3 * rays), opacity(rays);
  for (uint32_t ray = 0; ray < rays; ++ray) {
    for (uint32_t k = segments.first[ray + 1]; k-- > segments.first[ray];) {  // dst = src + (1 - α) dst
      const float alpha = segments.opacities[k];
      for (int c = 0; c < 3; ++c) {
        float& pixel = colour[3 * ray + c];
        pixel = segments.composited[7 * k + c] + alpha * segments.specular[3 * k + c] + (1 - alpha) * pixel;
      }
      opacity[ray] = alpha + (1 - alpha) * opacity[ray];
    }
  }
  const Picture picture = blend(stage, segments);
  expectNear(picture.colour, colour);
  expectNear(picture.opacity, opacity);
}

TEST_P(Blocks, LoseMostToTheOpacityLossWhenHalfOpaque) {
  Stage stage(*device, 86);
  const auto lossAndGradient = [&](float alpha) {
    OpacityLoss a;
    a.segments.capacity = 1;
    a.opacities = stage.input(std::vector<float>{alpha});
    a.loss = stage.output("loss", 1);
    a.opacityGradients = stage.input(std::vector<float>{0});
    device->run(a);
    return std::pair(device->read(a.loss)[0], device->read(a.opacityGradients)[0]);
  };
  EXPECT_NEAR(lossAndGradient(0.5f).first, std::log(2.0), 1e-6);
  EXPECT_NEAR(lossAndGradient(0.5f).second, 0, 1e-6);
  for (float alpha : {0.0f, 0.1f, 0.3f, 0.49f}) {
    EXPECT_LT(lossAndGradient(alpha).first, std::log(2.0)) << alpha;
    EXPECT_GT(lossAndGradient(alpha).second, 0) << "less opacity is less loss, " << alpha;
    EXPECT_LT(lossAndGradient(1 - alpha).second, 0) << alpha;
    EXPECT_NEAR(lossAndGradient(1 - alpha).first, lossAndGradient(alpha).first, 1e-6) << alpha;
  }
}

TEST_P(Blocks, HaveASparsityLossBetweenZeroAndOne) {
  Stage stage(*device, 87);
  const auto loss = [&](float low, float high) {
    SparsityLoss a;
    a.scale = 1.0f / 100;
    a.points.capacity = 100;
    a.logDensities = stage.randomInput(100, low, high);
    a.runtimeSteps = stage.randomInput(100, 1e-3f, 1e-2f);
    a.loss = stage.output("loss", 1);
    a.gradients = stage.output("gradients", 100);
    device->run(a);
    for (float g : device->read(a.gradients)) EXPECT_TRUE(g >= 0 && g <= 1) << g;
    return device->read(a.loss)[0];
  };
  EXPECT_NEAR(loss(-40, -30), 0, 1e-6);
  EXPECT_NEAR(loss(20, 80), 1, 1e-6);
  EXPECT_NEAR(loss(90, 1000), 1, 1e-6) << "where exp is infinite in float";
  const float between = loss(0, 10);
  EXPECT_GT(between, 0.1f);
  EXPECT_LT(between, 0.9f);
}

struct S3imResult {
  float loss;
  std::vector<float> gradients;
};

S3imResult s3im(Stage& stage, const std::vector<float>& predicted, const std::vector<float>& target,
                const std::vector<float>& weights, uint64_t seed = 1) {
  S3imLoss a;
  a.rays.capacity = static_cast<uint32_t>(predicted.size() / 3);
  a.patches = 4;
  a.seed = seed;
  a.predicted = stage.input(predicted);
  a.target = stage.input(target);
  a.weights = stage.input(weights);
  a.loss = stage.output("loss", 1);
  a.gradients = stage.input(std::vector<float>(predicted.size()));
  stage.device.run(a);
  return {stage.device.read(a.loss)[0], stage.device.read(a.gradients)};
}

TEST_P(Blocks, HaveNoS3imLossWhereRaysAreEqual) {
  Stage stage(*device, 88);
  const std::vector<float> predicted = stage.random.floats(3 * 100, 0, 1), target = stage.random.floats(3 * 100, 0, 1);
  const S3imResult equal = s3im(stage, predicted, predicted, {});
  EXPECT_NEAR(equal.loss, 0, 1e-6);
  for (float g : equal.gradients) EXPECT_NEAR(g, 0, 1e-6);
  const S3imResult unlike = s3im(stage, predicted, target, {});
  EXPECT_GT(unlike.loss, 0.5f);
  EXPECT_NE(s3im(stage, predicted, target, {}, 2).loss, unlike.loss) << "another seed makes other groups";
}

TEST_P(Blocks, LeaveRaysOfWeightZeroOutOfS3im) {
  Stage stage(*device, 89);
  const uint32_t rays = 96;  // six groups and nothing left over
  const std::vector<float> predicted = stage.random.floats(3 * rays, 0, 1);
  std::vector<float> target = stage.random.floats(3 * rays, 0, 1), weights(rays, 1);
  for (uint32_t ray = 0; ray < rays; ray += 3) weights[ray] = 0;
  const S3imResult before = s3im(stage, predicted, target, weights);
  for (uint32_t ray = 0; ray < rays; ++ray) {
    for (int c = 0; c < 3; ++c) EXPECT_EQ(before.gradients[3 * ray + c] == 0, weights[ray] == 0) << ray;
    if (weights[ray] == 0) target[3 * ray] += 0.3f;
  }
  const S3imResult after = s3im(stage, predicted, target, weights);
  EXPECT_EQ(after.loss, before.loss);
  expectTheSameSums(after.gradients, before.gradients);
  EXPECT_NEAR(s3im(stage, predicted, target, std::vector<float>(rays)).loss, 0, 1e-6);
}

INSTANTIATE_TEST_SUITE_P(Devices, Blocks, testing::ValuesIn(deviceNames()), [](const auto& info) {
  std::string name = info.param;
  std::replace(name.begin(), name.end(), ' ', '_');
  return name;
});

}  // namespace
}  // namespace tessera::device_test

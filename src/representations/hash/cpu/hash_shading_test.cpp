#include "representations/hash/cpu/hash_shading.h"

#include <gtest/gtest.h>

#include "raymarch/cpu/draw_scene.h"
#include "representations/hash/testing/test_hash_content.h"
#include "scene/spherical_harmonics.h"

namespace tessera {
namespace {

const Vec3d kDirection = Vec3d(1, 2, -3).normalized();

struct Sample {
  float opacity, depth;
  std::array<float, 7> values;
};

std::vector<Sample> randomSamples(size_t count) {
  const RandomStream random(3, 3);
  std::vector<Sample> samples;
  uint64_t next = 0;
  for (size_t i = 0; i < count; ++i) {
    Sample sample{0.3f * random.uniform(next++), static_cast<float>(i), {}};
    for (float& value : sample.values) value = 4 * random.uniform(next++) - 2;
    samples.push_back(sample);
  }
  return samples;
}

ContentComposite compositeSamples(std::span<const Sample> samples) {
  ContentComposite composite;
  for (const Sample& sample : samples) {
    const float weight = composite.transmittance * sample.opacity;
    for (int k = 0; k < 7; ++k) composite.values[k] += weight * sample.values[k];
    composite.depth += weight * sample.depth;
    composite.transmittance *= 1 - sample.opacity;
  }
  return composite;
}

DrawnPixel shade(const std::vector<const HashContent*>& contents, const std::vector<ContentComposite>& composites,
                 double far = INFINITY, std::vector<size_t> numbers = {}) {
  HashShading shading(contents, {});
  DrawnPixel pixel;
  shading.begin(3, {{Vec3d::Zero(), kDirection}, far});
  for (size_t i = 0; i < composites.size(); ++i) shading.add(3, composites[i], numbers.empty() ? i : numbers[i]);
  shading.end(3, pixel);
  shading.finish();
  return pixel;
}

void expectNear(const DrawnPixel& a, const DrawnPixel& b, double tolerance) {
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(a.colour[c], b.colour[c], tolerance);
  EXPECT_NEAR(a.transmittance, b.transmittance, tolerance);
  EXPECT_NEAR(a.depth, b.depth, tolerance * 50);
}

TEST(HashShading, IsIndependentOfHowSamplesAreDividedIntoContents) {
  const std::vector<Sample> samples = randomSamples(24);
  HashContent content;
  content.network = testHashNetwork(1);
  const DrawnPixel whole = shade({&content}, {compositeSamples(samples)});
  EXPECT_GT(whole.colour[0], 0.01f);
  for (size_t cut = 0; cut <= samples.size(); ++cut) {
    for (const size_t second : {cut, (cut + samples.size()) / 2}) {
      const std::span<const Sample> all(samples);
      const DrawnPixel pieces = shade({&content, &content, &content}, {compositeSamples(all.first(cut)),
                                                                       compositeSamples(all.subspan(cut, second - cut)),
                                                                       compositeSamples(all.subspan(second))});
      expectNear(pieces, whole, 1e-5);
    }
  }
}

// Blending finished colours gives a very different result, which is why features are composited instead.
TEST(HashShading, DiffersFromBlendingFinishedColours) {
  const std::vector<Sample> samples = randomSamples(24);
  HashContent content;
  content.network = testHashNetwork(1, 0);  // no network
  const std::span<const Sample> all(samples);
  const DrawnPixel whole = shade({&content}, {compositeSamples(all)});
  const DrawnPixel first = shade({&content}, {compositeSamples(all.first(12))}),
                   second = shade({&content}, {compositeSamples(all.subspan(12))});
  float largest = 0;
  for (int c = 0; c < 3; ++c) {
    largest = std::max(largest, std::abs(first.colour[c] + first.transmittance * second.colour[c] - whole.colour[c]));
  }
  EXPECT_GT(largest, 0.02f);
}

TEST(HashShading, IsNotChangedByEmptyContents) {
  const std::vector<Sample> samples = randomSamples(8);
  HashContent content, empty;
  content.network = testHashNetwork(1);
  empty.network = testHashNetwork(2, 3);
  const DrawnPixel alone = shade({&content}, {compositeSamples(samples)});
  for (const bool front : {true, false}) {
    const ContentComposite nothing, something = compositeSamples(samples);
    const DrawnPixel both =
        front ? shade({&empty, &content}, {nothing, something}) : shade({&content, &empty}, {something, nothing});
    expectNear(both, alone, 0);
  }
}

TEST(HashShading, LeavesRaysThatHitNothingTransparent) {
  HashContent content;
  content.network = testHashNetwork(1);
  const DrawnPixel pixel = shade({&content}, {ContentComposite()});
  expectNear(pixel, {}, 0);
}

TEST(HashShading, ShowsTheLearnedBackgroundWhereARayHitsNothing) {
  HashContent content;
  content.hasLearnedBackground = true;
  content.network = testHashNetwork(1);
  const DrawnPixel pixel = shade({&content}, {ContentComposite()});
  EXPECT_EQ(pixel.transmittance, 0);
  alignas(64) float values[DenseNetwork::kMaxWidth] = {};
  const std::array<float, 16> harmonics = evaluateHarmonics(kDirection);
  std::copy(harmonics.begin(), harmonics.end(), values + 7);
  DenseNetwork(content.network, 23, 3).run(values);
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(pixel.colour[c], 1 / (1 + std::exp(-values[c])), 1e-6);
}

TEST(HashShading, ShowsObjectsInFrontOfTheLearnedBackground) {
  const std::vector<Sample> samples = randomSamples(5);
  HashContent part, whole;
  part.network = whole.network = testHashNetwork(1);
  whole.hasLearnedBackground = true;
  const ContentComposite thin = compositeSamples(samples);
  ASSERT_GT(thin.transmittance, 0.2f);
  expectNear(shade({&whole}, {thin}, 7), shade({&part}, {thin}, 7), 1e-6);
  const DrawnPixel open = shade({&whole}, {thin}), closed = shade({&part}, {thin});
  EXPECT_EQ(open.transmittance, 0);
  EXPECT_NEAR(open.depth, closed.depth / (1 - closed.transmittance), 1e-4) << "the pixel is opaque";
  for (size_t c = 0; c < 3; ++c) EXPECT_NEAR(open.colour[c], closed.colour[c] / (1 - closed.transmittance), 1e-5);
}

TEST(HashShading, TakesTheLearnedBackgroundOfTheLastContent) {
  HashContent near, far;
  near.hasLearnedBackground = far.hasLearnedBackground = true;
  near.network = testHashNetwork(1);
  far.network = testHashNetwork(2);
  expectNear(shade({&near, &far}, {}), shade({&far}, {}), 0);
}

TEST(HashShading, AddsTheWeightsOfOneContentOverSeveralTiles) {
  const std::vector<Sample> samples = randomSamples(9);
  const std::span<const Sample> all(samples);
  HashContent one, other;
  one.network = testHashNetwork(1);
  other.network = testHashNetwork(2);
  const std::vector<ContentComposite> pieces = {compositeSamples(all.first(3)), compositeSamples(all.subspan(3, 4)),
                                                compositeSamples(all.subspan(7))};
  const float first = 1 - pieces[0].transmittance, second = pieces[0].transmittance * (1 - pieces[1].transmittance),
              third = pieces[0].transmittance * pieces[1].transmittance * (1 - pieces[2].transmittance);
  ASSERT_GT(first + third, second);
  expectNear(shade({&one, &other}, pieces, INFINITY, {0, 1, 0}), shade({&one, &one, &one}, pieces), 1e-6);
}

TEST(HashShading, TakesTheNetworkOfTheContentThatIsSeenMost) {
  const std::vector<Sample> samples = randomSamples(9);
  const std::span<const Sample> all(samples);
  HashContent one, other;
  one.network = testHashNetwork(1);
  other.network = testHashNetwork(2);
  const ContentComposite thin = compositeSamples(all.first(1)), thick = compositeSamples(all.subspan(1));
  ASSERT_GT((1 - thick.transmittance) * thin.transmittance, 1 - thin.transmittance);
  expectNear(shade({&one, &other}, {thin, thick}), shade({&other, &other}, {thin, thick}), 1e-6);
  ASSERT_GT(1 - thick.transmittance, (1 - thin.transmittance) * thick.transmittance);
  expectNear(shade({&one, &other}, {thick, thin}), shade({&one, &one}, {thick, thin}), 1e-6);
}

TEST(HashShading, CountsContentsOfOneNetworkTogether) {
  const std::vector<Sample> samples = randomSamples(12);
  const std::span<const Sample> all(samples);
  HashContent left, right, other;
  left.network = right.network = testHashNetwork(1);
  other.network = testHashNetwork(2);
  const std::vector<ContentComposite> pieces = {compositeSamples(all.first(4)), compositeSamples(all.subspan(4, 3)),
                                                compositeSamples(all.subspan(7))};
  const float first = 1 - pieces[0].transmittance, second = pieces[0].transmittance * (1 - pieces[1].transmittance),
              third = pieces[0].transmittance * pieces[1].transmittance * (1 - pieces[2].transmittance);
  ASSERT_GT(second, std::max(first, third));
  ASSERT_GT(first + third, second);
  expectNear(shade({&left, &other, &right}, pieces), shade({&left, &left, &left}, pieces), 1e-6);
}

Camera camera() {
  Camera camera;
  camera.width = 24;
  camera.height = 20;
  camera.parameters = {20, 20, 12, 10};
  return camera;
}

Pose lookingAlongX() {
  Mat3d rotation;
  rotation.col(0) = Vec3d(0, -1, 0);
  rotation.col(1) = Vec3d(0, 0, -1);
  rotation.col(2) = Vec3d(1, 0, 0);
  return {Eigen::AngleAxisd(0.1, Vec3d(1, 1, 1).normalized()) * rotation, Vec3d(-4, 0.1, 0.05)};
}

// With constant features it does not matter where rays are divided: into two cells, or one that is twice as wide.
TEST(DrawHash, RendersTheSameImageHoweverTheSceneIsDivided) {
  const std::vector<DenseLayer> network = testHashNetwork(4);
  const auto features = [](const Vec3d&) { return std::array<float, 8>{-0.4f, 1, -1, 0.5f, 2, -2, 1, 0.3f}; };
  const auto piece = [&](float low, float high) {
    HashPart part;
    part.scale = {2, 2, 2};
    part.low = {low, -1, -1};
    part.high = {high, 1, 1};
    makeHash(part, {}, features);
    return makeHashContent({part}, network);
  };
  const HashContent whole = piece(-2, 2), left = piece(-2, 0.3f), right = piece(0.3f, 2);
  ThreadPool pool(2);
  SceneDrawing<HashContent> uncut, cut;
  uncut.frame.low = cut.frame.low = Vec3d(-2, -1, -1);
  uncut.frame.high = cut.frame.high = Vec3d(2, 1, 1);
  uncut.march.minTransmittance = cut.march.minTransmittance = 0;
  uncut.frontToBack = {&whole};
  cut.frontToBack = {&left, &right};
  const RenderedView a = drawScene(uncut, camera(), lookingAlongX(), nullptr, pool);
  const RenderedView b = drawScene(cut, camera(), lookingAlongX(), nullptr, pool);
  float maximum = 0;
  for (size_t i = 0; i < a.colour.pixels.size(); ++i) {
    ASSERT_NEAR(a.colour.pixels[i], b.colour.pixels[i], 1e-5);
    maximum = std::max(maximum, a.colour.pixels[i]);
  }
  for (size_t i = 0; i < a.opacity.pixels.size(); ++i) ASSERT_NEAR(a.opacity.pixels[i], b.opacity.pixels[i], 1e-5);
  EXPECT_GT(maximum, 0.2f);
}

TEST(DrawHash, RendersTheSameImageWithAndWithoutSkippingOnAnyNumberOfThreads) {
  HashPart part;
  makeHash(part, {16, 64, 0.5f, [](const Vec3d& at) { return at.norm() < 0.5; }}, smoothFeatures);
  const HashContent content = makeHashContent({part}, testHashNetwork(5));
  SceneDrawing<HashContent> drawing;
  drawing.frontToBack = {&content};
  ThreadPool one(1), two(2);
  MarchCounts maximum, byCells, minimum;
  const RenderedView fast = drawScene(drawing, camera(), lookingAlongX(), nullptr, two, &minimum);
  drawing.march.useDistances = false;
  const RenderedView cells = drawScene(drawing, camera(), lookingAlongX(), nullptr, one, &byCells);
  drawing.march.skipEmptySpace = false;
  const RenderedView slow = drawScene(drawing, camera(), lookingAlongX(), nullptr, one, &maximum);
  EXPECT_EQ(fast.colour.pixels, slow.colour.pixels);
  EXPECT_EQ(fast.colour.pixels, cells.colour.pixels);
  EXPECT_EQ(fast.depth.pixels, slow.depth.pixels);
  EXPECT_EQ(minimum.samples, maximum.samples);
  EXPECT_GT(minimum.samples, 500u);
  EXPECT_LT(byCells.steps, maximum.steps);
  EXPECT_LE(minimum.steps, byCells.steps);
}

}  // namespace
}  // namespace tessera

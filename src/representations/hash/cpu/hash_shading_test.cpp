#include "representations/hash/cpu/hash_shading.h"

#include <gtest/gtest.h>

#include "raymarch/cpu/draw_scene.h"
#include "representations/hash/testing/made_hash.h"

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

ContentComposite compositeOf(std::span<const Sample> samples) {
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

TEST(HashShading, OfSamplesCutAnywhereIntoContentsIsThatOfOne) {
  const std::vector<Sample> samples = randomSamples(24);
  HashContent content;
  content.network = madeHashNetwork(1);
  const DrawnPixel whole = shade({&content}, {compositeOf(samples)});
  EXPECT_GT(whole.colour[0], 0.01f);
  for (size_t cut = 0; cut <= samples.size(); ++cut) {
    for (const size_t second : {cut, (cut + samples.size()) / 2}) {
      const std::span<const Sample> all(samples);
      const DrawnPixel pieces = shade(
          {&content, &content, &content},
          {compositeOf(all.first(cut)), compositeOf(all.subspan(cut, second - cut)), compositeOf(all.subspan(second))});
      expectNear(pieces, whole, 1e-5);
    }
  }
}

// What blending of finished colours would say is far from it: why sums are blended.
TEST(HashShading, OfFinishedColoursWouldBeAnother) {
  const std::vector<Sample> samples = randomSamples(24);
  HashContent content;
  content.network = madeHashNetwork(1, 0);  // no network
  const std::span<const Sample> all(samples);
  const DrawnPixel whole = shade({&content}, {compositeOf(all)});
  const DrawnPixel first = shade({&content}, {compositeOf(all.first(12))}),
                   second = shade({&content}, {compositeOf(all.subspan(12))});
  float largest = 0;
  for (int c = 0; c < 3; ++c) {
    largest = std::max(largest, std::abs(first.colour[c] + first.transmittance * second.colour[c] - whole.colour[c]));
  }
  EXPECT_GT(largest, 0.02f);
}

TEST(HashShading, OfAContentThatHoldsNothingChangesNothing) {
  const std::vector<Sample> samples = randomSamples(8);
  HashContent content, empty;
  content.network = madeHashNetwork(1);
  empty.network = madeHashNetwork(2, 3);
  const DrawnPixel alone = shade({&content}, {compositeOf(samples)});
  for (const bool front : {true, false}) {
    const ContentComposite nothing, something = compositeOf(samples);
    const DrawnPixel both =
        front ? shade({&empty, &content}, {nothing, something}) : shade({&content, &empty}, {something, nothing});
    expectNear(both, alone, 0);
  }
}

TEST(HashShading, OfNothingIsNothing) {
  HashContent content;
  content.network = madeHashNetwork(1);
  const DrawnPixel pixel = shade({&content}, {ContentComposite()});
  expectNear(pixel, {}, 0);
}

TEST(HashShading, OfNothingInAWholeSceneIsWhatTheNetworkSaysOfTheDirection) {
  HashContent content;
  content.isWhole = true;
  content.network = madeHashNetwork(1);
  const DrawnPixel pixel = shade({&content}, {ContentComposite()});
  EXPECT_EQ(pixel.transmittance, 0);
  alignas(64) float values[DenseNetwork::kMostWidth] = {};
  const std::array<float, 16> harmonics = harmonicsOf(kDirection);
  std::copy(harmonics.begin(), harmonics.end(), values + 7);
  DenseNetwork(content.network, 23, 3).run(values);
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(pixel.colour[c], 1 / (1 + std::exp(-values[c])), 1e-6);
}

TEST(HashShading, OfAWholeSceneLetsWhatStandsInItBeSeen) {
  const std::vector<Sample> samples = randomSamples(5);
  HashContent part, whole;
  part.network = whole.network = madeHashNetwork(1);
  whole.isWhole = true;
  const ContentComposite thin = compositeOf(samples);
  ASSERT_GT(thin.transmittance, 0.2f);
  expectNear(shade({&whole}, {thin}, 7), shade({&part}, {thin}, 7), 1e-6);
  const DrawnPixel open = shade({&whole}, {thin}), closed = shade({&part}, {thin});
  EXPECT_EQ(open.transmittance, 0);
  EXPECT_NEAR(open.depth, closed.depth / (1 - closed.transmittance), 1e-4) << "of an opaque pixel";
  for (size_t c = 0; c < 3; ++c) EXPECT_NEAR(open.colour[c], closed.colour[c] / (1 - closed.transmittance), 1e-5);
}

TEST(HashShading, OfNothingInAWholeSceneIsWhatItsLastContentSays) {
  HashContent near, far;
  near.isWhole = far.isWhole = true;
  near.network = madeHashNetwork(1);
  far.network = madeHashNetwork(2);
  expectNear(shade({&near, &far}, {}), shade({&far}, {}), 0);
}

TEST(HashShading, AddsUpWhatOneContentShowsInSeveralTiles) {
  const std::vector<Sample> samples = randomSamples(9);
  const std::span<const Sample> all(samples);
  HashContent one, other;
  one.network = madeHashNetwork(1);
  other.network = madeHashNetwork(2);
  const std::vector<ContentComposite> pieces = {compositeOf(all.first(3)), compositeOf(all.subspan(3, 4)),
                                                compositeOf(all.subspan(7))};
  const float first = 1 - pieces[0].transmittance, second = pieces[0].transmittance * (1 - pieces[1].transmittance),
              third = pieces[0].transmittance * pieces[1].transmittance * (1 - pieces[2].transmittance);
  ASSERT_GT(first + third, second);
  expectNear(shade({&one, &other}, pieces, INFINITY, {0, 1, 0}), shade({&one, &one, &one}, pieces), 1e-6);
}

TEST(HashShading, TakesTheNetworkOfTheContentThatIsSeenMost) {
  const std::vector<Sample> samples = randomSamples(9);
  const std::span<const Sample> all(samples);
  HashContent one, other;
  one.network = madeHashNetwork(1);
  other.network = madeHashNetwork(2);
  const ContentComposite thin = compositeOf(all.first(1)), thick = compositeOf(all.subspan(1));
  ASSERT_GT((1 - thick.transmittance) * thin.transmittance, 1 - thin.transmittance);
  expectNear(shade({&one, &other}, {thin, thick}), shade({&other, &other}, {thin, thick}), 1e-6);
  ASSERT_GT(1 - thick.transmittance, (1 - thin.transmittance) * thick.transmittance);
  expectNear(shade({&one, &other}, {thick, thin}), shade({&one, &one}, {thick, thin}), 1e-6);
}

TEST(HashShading, CountsContentsOfOneNetworkTogether) {
  const std::vector<Sample> samples = randomSamples(12);
  const std::span<const Sample> all(samples);
  HashContent left, right, other;
  left.network = right.network = madeHashNetwork(1);
  other.network = madeHashNetwork(2);
  const std::vector<ContentComposite> pieces = {compositeOf(all.first(4)), compositeOf(all.subspan(4, 3)),
                                                compositeOf(all.subspan(7))};
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

// Where every step sees the same, it does not matter where rays are cut: two cells and one twice as wide.
TEST(DrawHash, CutAnywhereLooksAsItDoesUncut) {
  const std::vector<DenseLayer> network = madeHashNetwork(4);
  const auto features = [](const Vec3d&) { return std::array<float, 8>{-0.4f, 1, -1, 0.5f, 2, -2, 1, 0.3f}; };
  const auto piece = [&](float low, float high) {
    HashPart part;
    part.scale = {2, 2, 2};
    part.low = {low, -1, -1};
    part.high = {high, 1, 1};
    makeHash(part, {}, features);
    return hashContentOf({part}, network);
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
  float most = 0;
  for (size_t i = 0; i < a.colour.pixels.size(); ++i) {
    ASSERT_NEAR(a.colour.pixels[i], b.colour.pixels[i], 1e-5);
    most = std::max(most, a.colour.pixels[i]);
  }
  for (size_t i = 0; i < a.opacity.pixels.size(); ++i) ASSERT_NEAR(a.opacity.pixels[i], b.opacity.pixels[i], 1e-5);
  EXPECT_GT(most, 0.2f);
}

TEST(DrawHash, IsThePictureWithAndWithoutSkippingAndWhateverTheThreads) {
  HashPart part;
  makeHash(part, {16, 64, 0.5f, [](const Vec3d& at) { return at.norm() < 0.5; }}, smoothFeatures);
  const HashContent content = hashContentOf({part}, madeHashNetwork(5));
  SceneDrawing<HashContent> drawing;
  drawing.frontToBack = {&content};
  ThreadPool one(1), two(2);
  MarchCounts most, byCells, fewest;
  const RenderedView fast = drawScene(drawing, camera(), lookingAlongX(), nullptr, two, &fewest);
  drawing.march.useDistances = false;
  const RenderedView cells = drawScene(drawing, camera(), lookingAlongX(), nullptr, one, &byCells);
  drawing.march.skipEmptySpace = false;
  const RenderedView slow = drawScene(drawing, camera(), lookingAlongX(), nullptr, one, &most);
  EXPECT_EQ(fast.colour.pixels, slow.colour.pixels);
  EXPECT_EQ(fast.colour.pixels, cells.colour.pixels);
  EXPECT_EQ(fast.depth.pixels, slow.depth.pixels);
  EXPECT_EQ(fewest.samples, most.samples);
  EXPECT_GT(fewest.samples, 500u);
  EXPECT_LT(byCells.steps, most.steps);
  EXPECT_LE(fewest.steps, byCells.steps);
}

}  // namespace
}  // namespace tessera

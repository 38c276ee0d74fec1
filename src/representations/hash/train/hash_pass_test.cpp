#include "representations/hash/train/hash_pass.h"

#include <gtest/gtest.h>

#include <cmath>

#include "base/random.h"
#include "compute/reference/functions.h"
#include "field/testing/expect_gradients.h"
#include "representations/hash/testing/hash_cube.h"

namespace tessera {
namespace {

constexpr uint32_t kRays = 48;

std::vector<float> randomFloats(uint64_t seed, size_t count, float low, float high) {
  const RandomStream random(seed, 0x9a55);
  std::vector<float> values(count);
  for (size_t i = 0; i < count; ++i) values[i] = low + (high - low) * random.uniform(i);
  return values;
}

// A small model with random parameters that matter, seen by rays from above.
struct Scene {
  std::unique_ptr<Device> device = makeDevice({"cpu", 2});
  std::unique_ptr<HashModel> model;
  std::unique_ptr<HashPass> pass;
  Array<float> origins, directions, jitter;

  explicit Scene(const HashConfig& config, int columns = 2) {
    model = std::make_unique<HashModel>(*device, config, cubeGrid(columns));
    for (uint32_t block = 0; block < model->space().blocks(); ++block) {
      uint64_t seed = 7 + 100 * uint64_t{block};
      for (ParameterGroup* table : {&model->fields().coarse().table(block), &model->fields().fine(block)}) {
        device->write(table->values.all(), std::span<const float>(randomFloats(++seed, table->values.size(), -1, 1)));
      }
    }
    pass = std::make_unique<HashPass>(*model, HashPass::Room{kRays, 1 << 14, 1 << 16, true});
    // From above, at places in the blocks.
    std::vector<float> from = randomFloats(1, 3 * kRays, -2, 2), along = randomFloats(2, 3 * kRays, -1, 1);
    for (uint32_t r = 0; r < kRays; ++r) {
      from[3 * r + 2] = 2;
      for (size_t i = size_t{3} * r; i < size_t{3} * r + 3; ++i) along[i] -= from[i];
      const float length = std::hypot(along[3 * r], along[3 * r + 1], along[3 * r + 2]);
      for (size_t i = size_t{3} * r; i < size_t{3} * r + 3; ++i) along[i] /= length;
    }
    origins = device->arrayOf(from);
    directions = device->arrayOf(along);
    jitter = device->arrayOf(randomFloats(3, kRays, 0, 1));
  }
  HashModel::Rays rays() const { return {kRays, origins, directions, jitter, {}, {}}; }
  double loss(const std::vector<float>& colour, const std::vector<float>& opacity) {
    pass->forward(rays(), 1e-4f);
    const std::vector<float> c = device->read(pass->colour()), o = device->read(pass->opacity());
    double sum = 0;
    for (size_t i = 0; i < colour.size(); ++i) sum += static_cast<double>(colour[i]) * c[i];
    for (size_t i = 0; i < opacity.size(); ++i) sum += static_cast<double>(opacity[i]) * o[i];
    return sum;
  }
  std::vector<ParameterGroup*> groups() {
    const uint32_t last = model->space().blocks() - 1;
    std::vector<ParameterGroup*> all = model->fields().sharedGroups();
    all.push_back(&model->direction());
    for (ParameterGroup* group : model->fields().groupsOf(last)) all.push_back(group);
    return all;
  }
};

// Invariant 4.
TEST(HashPass, HasTheGradientsOfItsPictureInEveryParameter) {
  struct Way {
    const char *aggregation, *attention, *background;
    bool varies;
  };
  for (const Way& way : {Way{"attention", "separate", "random", true}, Way{"attention", "shared", "random", false},
                         Way{"sum", "separate", "learned", true}, Way{"mlp", "separate", "random", true}}) {
    HashConfig config = smallHashConfig();
    config.surround = "own";
    config.aggregation = way.aggregation;
    config.attention = way.attention;
    config.attentionVaries = way.varies;
    config.background = way.background;
    Scene scene(config);
    SCOPED_TRACE(std::string(way.aggregation) + " " + way.attention + " " + way.background);
    const std::vector<float> colour = randomFloats(4, 3 * kRays, -1, 1), opacity = randomFloats(5, kRays, -1, 1);
    scene.loss(colour, opacity);
    Array<float> ofOpacity = scene.device->arrayOf(opacity);
    scene.pass->backward(scene.rays(), scene.device->arrayOf(colour), ofOpacity, {}, {});
    for (ParameterGroup* group : scene.groups()) {
      expectGradientsOfDifferences(*scene.device, *group, [&] { return scene.loss(colour, opacity); });
    }
  }
}

// Section 13 of the specification: sums over samples know no blocks.
TEST(HashPass, WeighsSamplesOfSeveralBlocksAsThoseOfOneVolume) {
  HashConfig config = smallHashConfig();
  config.surround = "own";
  Scene scene(config);
  scene.pass->forward(scene.rays(), 1e-4f);
  const HashSamples& seen = scene.pass->samples();
  const std::vector<uint32_t> first = scene.device->read(seen.firstSample.all()),
                              slots = scene.device->read(seen.slotOfSample.all());
  const std::vector<float> weights = scene.device->read(scene.pass->weights()),
                           steps = scene.device->read(seen.steps.all()),
                           opacity = scene.device->read(scene.pass->opacity());
  const std::vector<float> features =
      scene.device->read(scene.model->fields().forward(seen.places(), false).data.part(0, size_t{8} * first[kRays]));
  int crossing = 0;
  for (uint32_t r = 0; r < kRays; ++r) {
    double transmittance = 1;
    for (uint32_t s = first[r]; s < first[r + 1]; ++s) {
      const double alpha = 1 - std::exp(-std::exp(static_cast<double>(features[size_t{8} * s])) * steps[s]);
      EXPECT_NEAR(weights[s], transmittance * alpha, 1e-5);
      transmittance *= 1 - alpha;
    }
    EXPECT_NEAR(opacity[r], 1 - transmittance, 1e-4);
    crossing += first[r] < first[r + 1] && slots[first[r]] != slots[first[r + 1] - 1];
  }
  EXPECT_GT(crossing, 5) << "rays that pass from block to block";
}

// Invariant 15.
TEST(HashPass, ShowsWhereNothingIsWhatItsNetworkSaysOfTheDirection) {
  HashConfig config = smallHashConfig();
  config.background = "learned";
  Scene scene(config);
  HashModel::Rays rays = scene.rays();
  const Array<float> far = scene.device->arrayOf(std::vector<float>(kRays, 0.1f));  // before the box
  rays.far = far;
  scene.pass->forward(rays, 1e-4f);
  const std::vector<float> colour = scene.device->read(scene.pass->colour());
  const std::vector<float> directions = scene.device->read(scene.directions.all());
  const MlpShape shape = config.directionShape();
  const std::vector<float> network = scene.device->read(scene.model->direction().values.all());
  const reference::Doubles weights(network.begin(), network.end());
  for (uint32_t r = 0; r < kRays; ++r) {
    const double d[3] = {directions[3 * r], directions[3 * r + 1], directions[3 * r + 2]};
    reference::Doubles input(7);
    const reference::Doubles harmonics = reference::sphericalHarmonics(4, d);
    input.insert(input.end(), harmonics.begin(), harmonics.end());
    const reference::Doubles said = reference::mlpForward(shape, 1, input, weights).output;
    for (size_t c = 0; c < 3; ++c) EXPECT_NEAR(colour[3 * r + c], 1 / (1 + std::exp(-said[c])), 1e-5);
  }
  for (const float opacity : scene.device->read(scene.pass->opacity())) EXPECT_EQ(opacity, 0);
}

// Invariant 10.
TEST(HashPass, ChangesLittleWhereRaysEndEarly) {
  Scene scene(smallHashConfig());
  for (uint32_t block = 0; block < scene.model->space().blocks(); ++block) {  // so dense that rays end
    ParameterGroup& fine = scene.model->fields().fine(block);
    std::vector<float> values = scene.device->read(fine.values.all());
    for (size_t i = 0; i < values.size(); i += AttentionShape::kFeatures) values[i] += 3;
    scene.device->write(fine.values.all(), std::span<const float>(values));
  }
  constexpr float kEnd = 2e-3f;
  scene.pass->forward(scene.rays(), 1e-6f);
  const std::vector<float> whole = scene.device->read(scene.pass->sums());
  const uint32_t all = scene.device->read(scene.pass->counters())[MarchRounds::kKept];
  const Matrix<const float> features = scene.model->fields().forward(scene.pass->samples().places(), false);
  const std::vector<float> ofSamples = scene.device->read(features.data);
  float largest = 0;
  for (uint32_t s = 0; s < all; ++s) {
    for (uint32_t f = 1; f < AttentionShape::kFeatures; ++f) {
      largest = std::max(largest, std::abs(ofSamples[s * size_t{features.rowStride} + f]));
    }
  }
  scene.pass->forward(scene.rays(), kEnd);
  const std::vector<float> early = scene.device->read(scene.pass->sums());
  EXPECT_LT(scene.device->read(scene.pass->counters())[MarchRounds::kKept], 0.9 * all) << "rays that end early";
  float change = 0;
  for (size_t i = 0; i < whole.size(); ++i) change = std::max(change, std::abs(early[i] - whole[i]));
  EXPECT_LE(change, kEnd * largest);
  EXPECT_GT(change, 0.01 * kEnd * largest) << "some do end early";
}

}  // namespace
}  // namespace tessera

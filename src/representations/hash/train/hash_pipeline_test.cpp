#include "representations/hash/train/hash_pipeline.h"

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

// A small model with large random parameters, and rays towards it from above.
struct Scene {
  std::unique_ptr<Device> device = makeDevice({"cpu", 2});
  std::unique_ptr<HashModel> model;
  std::unique_ptr<HashPipeline> pipeline;
  Array<float> origins, directions, jitter;

  explicit Scene(const HashConfig& config, int columns = 2) {
    model = std::make_unique<HashModel>(*device, config, cubeGrid(columns));
    for (uint32_t block = 0; block < model->space().blocks(); ++block) {
      uint64_t seed = 7 + 100 * uint64_t{block};
      for (ParameterGroup* table : {&model->fields().coarse().table(block), &model->fields().fine(block)}) {
        device->write(table->values.all(), std::span<const float>(randomFloats(++seed, table->values.size(), -1, 1)));
      }
    }
    pipeline = std::make_unique<HashPipeline>(*model, HashPipeline::Capacity{kRays, 1 << 14, 1 << 16, true});
    // Rays start above the blocks and point at places inside them.
    std::vector<float> from = randomFloats(1, 3 * kRays, -2, 2), along = randomFloats(2, 3 * kRays, -1, 1);
    for (uint32_t r = 0; r < kRays; ++r) {
      from[3 * r + 2] = 2;
      for (size_t i = size_t{3} * r; i < size_t{3} * r + 3; ++i) along[i] -= from[i];
      const float length = std::hypot(along[3 * r], along[3 * r + 1], along[3 * r + 2]);
      for (size_t i = size_t{3} * r; i < size_t{3} * r + 3; ++i) along[i] /= length;
    }
    origins = device->uploadArray(from);
    directions = device->uploadArray(along);
    jitter = device->uploadArray(randomFloats(3, kRays, 0, 1));
  }
  HashModel::Rays rays() const { return {kRays, origins, directions, jitter, {}, {}}; }
  double loss(const std::vector<float>& colour, const std::vector<float>& opacity) {
    pipeline->forward(rays(), 1e-4f);
    const std::vector<float> c = device->read(pipeline->colour()), o = device->read(pipeline->opacity());
    double sum = 0;
    for (size_t i = 0; i < colour.size(); ++i) sum += static_cast<double>(colour[i]) * c[i];
    for (size_t i = 0; i < opacity.size(); ++i) sum += static_cast<double>(opacity[i]) * o[i];
    return sum;
  }
  std::vector<ParameterGroup*> groups() {
    const uint32_t last = model->space().blocks() - 1;
    std::vector<ParameterGroup*> all = model->fields().sharedGroups();
    all.push_back(&model->direction());
    for (ParameterGroup* group : model->fields().slotParameterGroups(last)) all.push_back(group);
    return all;
  }
};

// Invariant 4 of `hash` (docs/invariants.md).
TEST(HashPipeline, ComputesTheGradientsOfItsImageForEveryParameter) {
  struct Variant {
    const char *aggregation, *attention, *background;
    bool varies;
  };
  for (const Variant& variant :
       {Variant{"attention", "separate", "random", true}, Variant{"attention", "shared", "random", false},
        Variant{"sum", "separate", "learned", true}, Variant{"mlp", "separate", "random", true}}) {
    HashConfig config = smallHashConfig();
    config.backgroundBlock = "own";
    config.aggregation = variant.aggregation;
    config.attention = variant.attention;
    config.attentionVaries = variant.varies;
    config.background = variant.background;
    Scene scene(config);
    SCOPED_TRACE(std::string(variant.aggregation) + " " + variant.attention + " " + variant.background);
    const std::vector<float> colour = randomFloats(4, 3 * kRays, -1, 1), opacity = randomFloats(5, kRays, -1, 1);
    scene.loss(colour, opacity);
    Array<float> opacityGradients = scene.device->uploadArray(opacity);
    scene.pipeline->backward(scene.rays(), scene.device->uploadArray(colour), opacityGradients, {}, {});
    for (ParameterGroup* group : scene.groups()) {
      expectGradientsOfDifferences(*scene.device, *group, [&] { return scene.loss(colour, opacity); });
    }
  }
}

// Compositing does not depend on the block to which a sample belongs.
TEST(HashPipeline, WeighsSamplesOfSeveralBlocksAsThoseOfOneVolume) {
  HashConfig config = smallHashConfig();
  config.backgroundBlock = "own";
  Scene scene(config);
  scene.pipeline->forward(scene.rays(), 1e-4f);
  const HashSamples& seen = scene.pipeline->samples();
  const std::vector<uint32_t> first = scene.device->read(seen.firstSample.all()),
                              slots = scene.device->read(seen.slotOfSample.all());
  const std::vector<float> weights = scene.device->read(scene.pipeline->weights()),
                           steps = scene.device->read(seen.steps.all()),
                           opacity = scene.device->read(scene.pipeline->opacity());
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

// Invariant 15 of `hash` (docs/invariants.md).
TEST(HashPipeline, ShowsTheLearnedBackgroundWhereARayHitsNothing) {
  HashConfig config = smallHashConfig();
  config.background = "learned";
  Scene scene(config);
  HashModel::Rays rays = scene.rays();
  const Array<float> far = scene.device->uploadArray(std::vector<float>(kRays, 0.1f));  // rays end in front of the box
  rays.far = far;
  scene.pipeline->forward(rays, 1e-4f);
  const std::vector<float> colour = scene.device->read(scene.pipeline->colour());
  const std::vector<float> directions = scene.device->read(scene.directions.all());
  const MlpShape shape = config.directionShape();
  const std::vector<float> network = scene.device->read(scene.model->direction().values.all());
  const reference::Doubles weights(network.begin(), network.end());
  for (uint32_t r = 0; r < kRays; ++r) {
    const double d[3] = {directions[3 * r], directions[3 * r + 1], directions[3 * r + 2]};
    reference::Doubles input(7);
    const reference::Doubles harmonics = reference::sphericalHarmonics(4, d);
    input.insert(input.end(), harmonics.begin(), harmonics.end());
    const reference::Doubles output = reference::mlpForward(shape, 1, input, weights).output;
    for (size_t c = 0; c < 3; ++c) EXPECT_NEAR(colour[3 * r + c], 1 / (1 + std::exp(-output[c])), 1e-5);
  }
  for (const float opacity : scene.device->read(scene.pipeline->opacity())) EXPECT_EQ(opacity, 0);
}

// Invariant 10 of `hash` (docs/invariants.md).
TEST(HashPipeline, ChangesLittleWhereRaysEndEarly) {
  Scene scene(smallHashConfig());
  for (uint32_t block = 0; block < scene.model->space().blocks(); ++block) {  // make it so dense that rays end early
    ParameterGroup& fine = scene.model->fields().fine(block);
    std::vector<float> values = scene.device->read(fine.values.all());
    for (size_t i = 0; i < values.size(); i += AttentionShape::kFeatures) values[i] += 3;
    scene.device->write(fine.values.all(), std::span<const float>(values));
  }
  constexpr float kEnd = 2e-3f;
  scene.pipeline->forward(scene.rays(), 1e-6f);
  const std::vector<float> whole = scene.device->read(scene.pipeline->sums());
  const uint32_t all = scene.device->read(scene.pipeline->counters())[MarchRounds::kVisible];
  const Matrix<const float> features = scene.model->fields().forward(scene.pipeline->samples().places(), false);
  const std::vector<float> sampleFeatures = scene.device->read(features.data);
  float largest = 0;
  for (uint32_t s = 0; s < all; ++s) {
    for (uint32_t f = 1; f < AttentionShape::kFeatures; ++f) {
      largest = std::max(largest, std::abs(sampleFeatures[s * size_t{features.rowStride} + f]));
    }
  }
  scene.pipeline->forward(scene.rays(), kEnd);
  const std::vector<float> early = scene.device->read(scene.pipeline->sums());
  EXPECT_LT(scene.device->read(scene.pipeline->counters())[MarchRounds::kVisible], 0.9 * all) << "some rays end early";
  float change = 0;
  for (size_t i = 0; i < whole.size(); ++i) change = std::max(change, std::abs(early[i] - whole[i]));
  EXPECT_LE(change, kEnd * largest);
  EXPECT_GT(change, 0.01 * kEnd * largest) << "some rays end early";
}

}  // namespace
}  // namespace tessera

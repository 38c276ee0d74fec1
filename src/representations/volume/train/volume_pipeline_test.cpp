#include "representations/volume/train/volume_pipeline.h"

#include <gtest/gtest.h>

#include <cmath>

#include "base/error.h"
#include "base/random.h"
#include "field/testing/expect_gradients.h"
#include "representations/volume/testing/volume_cube.h"

namespace tessera {
namespace {

constexpr uint32_t kRays = 48;

std::vector<float> randomFloats(uint64_t seed, size_t count, float low, float high) {
  const RandomStream random(seed, 0x9a55);
  std::vector<float> values(count);
  for (size_t i = 0; i < count; ++i) values[i] = low + (high - low) * random.uniform(i);
  return values;
}

// A small model with random parameters that affect the image, seen by rays from above.
struct Scene {
  std::unique_ptr<Device> device = makeDevice({"cpu", 2});
  std::unique_ptr<VolumeModel> model;
  std::unique_ptr<VolumePipeline> pipeline;
  Array<float> origins, directions, jitter;

  explicit Scene(VolumeConfig config, int columns = 2) {
    config.opacityWeight = 0;
    model = std::make_unique<VolumeModel>(*device, config, cubeGrid(columns));
    for (uint32_t block = 0; block < model->space().blocks(); ++block) {
      ParameterGroup& table = model->attributes().table(block);
      device->write(table.values.all(), std::span<const float>(randomFloats(7 + block, table.values.size(), -1, 1)));
    }
    VolumePipeline::Capacity capacity;
    capacity.rays = kRays;
    capacity.texels = 20 * 20 * kRays;
    capacity.training = true;
    pipeline = std::make_unique<VolumePipeline>(*model, capacity);
    // Rays from above towards positions in the blocks.
    std::vector<float> from = randomFloats(1, 3 * kRays, -2, 2), along = randomFloats(2, 3 * kRays, -1, 1);
    for (uint32_t r = 0; r < kRays; ++r) {
      from[3 * r + 2] = 2;
      for (size_t i = size_t{3} * r; i < size_t{3} * r + 3; ++i) along[i] -= from[i];
      const float length = std::hypot(along[3 * r], along[3 * r + 1], along[3 * r + 2]);
      for (size_t i = size_t{3} * r; i < size_t{3} * r + 3; ++i) along[i] /= length;
    }
    origins = device->uploadArray(from);
    directions = device->uploadArray(along);
    jitter = device->uploadArray(randomFloats(3, 3 * kRays, 0, 1));
  }
  VolumeRays rays() const { return {kRays, origins, directions, jitter, {}, {}}; }
  uint32_t texelsDemanded() { return device->read(pipeline->texelsDemanded())[0]; }
  double loss(const std::vector<float>& colour, const std::vector<float>& opacity) {
    pipeline->forward(rays(), {});
    const std::vector<float> c = device->read(pipeline->colour()), o = device->read(pipeline->opacity());
    double sum = 0;
    for (size_t i = 0; i < colour.size(); ++i) sum += static_cast<double>(colour[i]) * c[i];
    for (size_t i = 0; i < opacity.size(); ++i) sum += static_cast<double>(opacity[i]) * o[i];
    return sum;
  }
};

TEST(VolumePipeline, MatchesFiniteDifferencesInEveryParameterGroup) {
  for (const char* backgroundBlock : {"none", "own"}) {
    VolumeConfig config = smallVolumeConfig();
    config.quantise = false;  // gradients pass straight through rounding, finite differences do not
    config.backgroundBlock = backgroundBlock;
    Scene scene(config);
    const std::vector<float> colour = randomFloats(4, 3 * kRays, -1, 1), opacity = randomFloats(5, kRays, -1, 1);
    scene.loss(colour, opacity);
    scene.pipeline->backward(scene.rays(), scene.device->uploadArray(colour), scene.device->uploadArray(opacity), {});
    VolumeModel& model = *scene.model;
    const uint32_t last = model.space().blocks() - 1;
    for (ParameterGroup* group : {&model.attributes().network(0), &model.attributes().network(last), &model.deferred(),
                                  &model.attributes().table(1)}) {
      expectGradientsOfDifferences(*scene.device, *group, [&] { return scene.loss(colour, opacity); });
    }
  }
}

TEST(VolumePipeline, GivesTheSamePictureWhetherTexelsAreSharedOrNot) {
  VolumeConfig config = smallVolumeConfig();
  Scene shared(config, 1);
  config.shareTexels = false;
  Scene apart(config, 1);
  const std::vector<float> colour = randomFloats(4, 3 * kRays, -1, 1), opacity = randomFloats(5, kRays, -1, 1);
  shared.loss(colour, opacity);
  apart.loss(colour, opacity);
  EXPECT_EQ(shared.device->read(shared.pipeline->colour()), apart.device->read(apart.pipeline->colour()));
  EXPECT_LT(shared.texelsDemanded(), apart.texelsDemanded());
  for (Scene* scene : {&shared, &apart}) {
    scene->pipeline->backward(scene->rays(), scene->device->uploadArray(colour), scene->device->uploadArray(opacity),
                              {});
  }
  const std::vector<float> one = shared.device->read(shared.model->attributes().network(0).gradients.all());
  const std::vector<float> other = apart.device->read(apart.model->attributes().network(0).gradients.all());
  double largest = 0;
  for (const float g : one) largest = std::max<double>(largest, std::abs(g));
  for (size_t i = 0; i < one.size(); ++i) ASSERT_NEAR(one[i], other[i], 1e-4 * largest);
}

TEST(VolumePipeline, RejectsSeveralBlocksWhereTexelsAreNotShared) {
  VolumeConfig config = smallVolumeConfig();
  config.shareTexels = false;
  EXPECT_THROW(Scene(config, 2), Error);
}

TEST(VolumePipeline, CompositesBlocksAsOneVolumeWhereNothingDependsOnTheDirection) {
  Scene scene(smallVolumeConfig());
  std::vector<float> deferred(scene.model->deferred().values.size());
  for (size_t network = 0; network < deferred.size() / DeferredNetwork::kParameters; ++network) {
    // With these last biases the networks output a sigmoid of practically 0.
    for (size_t i = 1; i <= 3; ++i) deferred[(network + 1) * DeferredNetwork::kParameters - i] = -100;
  }
  scene.device->write(scene.model->deferred().values.all(), std::span<const float>(deferred));
  scene.pipeline->forward(scene.rays(), {});
  const std::vector<float> colour = scene.device->read(scene.pipeline->colour());
  const std::vector<float> opacity = scene.device->read(scene.pipeline->opacity());
  const std::vector<float> weights = scene.device->read(scene.pipeline->weights());
  const std::vector<float> colours = scene.device->read(scene.pipeline->colours());
  const std::vector<uint32_t> first = scene.device->read(scene.pipeline->firstSample());
  const std::vector<uint32_t> blocks = scene.device->read(scene.pipeline->blockOfSample());
  int crossing = 0;
  for (uint32_t r = 0; r < kRays; ++r) {
    double sum[3] = {0, 0, 0}, whole = 0;
    for (uint32_t s = first[r]; s < first[r + 1]; ++s) {
      for (int k = 0; k < 3; ++k) sum[k] += weights[s] * colours[7 * s + static_cast<uint32_t>(k)];
      whole += weights[s];
    }
    crossing += blocks[first[r]] != blocks[first[r + 1] - 1];
    for (int k = 0; k < 3; ++k) EXPECT_NEAR(colour[3 * r + static_cast<uint32_t>(k)], sum[k], 1e-5);
    EXPECT_NEAR(opacity[r], whole, 1e-5);
  }
  EXPECT_GT(crossing, 5) << "rays that cross from block to block";
}

// Invariant 13 of docs/invariants.md: with the same resolution and nothing that depends on the direction, merged blocks
// look like separate ones.
TEST(VolumePipeline, RendersMergedBlocksLikeSeparateOnesWhereNothingDependsOnTheDirection) {
  VolumeConfig config = smallVolumeConfig();
  Scene apart(config);
  config.lod = 1;
  Scene merged(config);
  merged.model->copyFields(*apart.model);
  for (Scene* scene : {&apart, &merged}) {
    std::vector<float> deferred(scene->model->deferred().values.size());
    for (size_t network = 0; network < deferred.size() / DeferredNetwork::kParameters; ++network) {
      for (size_t i = 1; i <= 3; ++i) deferred[(network + 1) * DeferredNetwork::kParameters - i] = -100;
    }
    scene->device->write(scene->model->deferred().values.all(), std::span<const float>(deferred));
    scene->pipeline->forward(scene->rays(), {});
  }
  EXPECT_EQ(merged.model->deferred().values.size() * 2, apart.model->deferred().values.size());
  const std::vector<float> one = apart.device->read(apart.pipeline->colour());
  const std::vector<float> other = merged.device->read(merged.pipeline->colour());
  for (size_t i = 0; i < one.size(); ++i) EXPECT_NEAR(one[i], other[i], 1e-5);
}

TEST(VolumePipeline, EndsRaysAtOpaqueThings) {
  Scene scene(smallVolumeConfig());
  VolumeRays rays = scene.rays();
  const Array<float> far = scene.device->uploadArray(std::vector<float>(kRays, 0.5f));  // above the box
  rays.far = far;
  scene.pipeline->forward(rays, {});
  for (const float opacity : scene.device->read(scene.pipeline->opacity())) EXPECT_EQ(opacity, 0);
}

TEST(VolumePipeline, ReportsTheTexelsThatItDemandsAndWorksWithFewer) {
  VolumeConfig config = smallVolumeConfig();
  Scene scene(config);
  scene.pipeline->forward(scene.rays(), {});
  const uint32_t demanded = scene.texelsDemanded();
  VolumePipeline::Capacity capacity;
  capacity.rays = kRays;
  capacity.texels = demanded / 2;
  capacity.training = true;
  VolumePipeline tight(*scene.model, capacity);
  tight.forward(scene.rays(), {});
  EXPECT_EQ(scene.device->read(tight.texelsDemanded())[0], demanded);
  for (const float value : scene.device->read(tight.colour())) EXPECT_TRUE(std::isfinite(value));
}

}  // namespace
}  // namespace tessera

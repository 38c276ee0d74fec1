#include "representations/mesh/train/mesh_field.h"

#include <gtest/gtest.h>

#include <cmath>

#include "base/random.h"
#include "field/testing/expect_gradients.h"

namespace tessera {
namespace {

constexpr uint32_t kSamples = 21, kRays = 4;

MeshFieldShape smallShape() {
  HashGridOptions grid;
  grid.levels = 3;
  grid.log2TableSize = 7;  // the finest level is hashed
  grid.baseResolution = 3;
  grid.finestResolution = 12;
  return makeMeshFieldShape(grid, 16, 2);
}

// A field on the reference device, samples, and the scalar Σ a · logit + Σ b · colour of its outputs.
struct Scene {
  std::unique_ptr<Device> device = makeDevice({"reference", 1});
  MeshField field{*device, smallShape(), 1};
  std::vector<float> at, logitFactors, colourFactors;
  Array<float> positions, directions;
  Array<uint32_t> rayOfSample;

  Scene() {
    const RandomStream random(7, 8);
    uint64_t next = 0;
    std::vector<float> along;
    std::vector<uint32_t> rays;
    for (uint32_t i = 0; i < kSamples; ++i) {
      for (int axis = 0; axis < 3; ++axis) at.push_back(0.05f + 0.9f * random.uniform(next++));
      rays.push_back(i * kRays / kSamples);
      logitFactors.push_back(2 * random.uniform(next++) - 1);
      for (int channel = 0; channel < 3; ++channel) colourFactors.push_back(2 * random.uniform(next++) - 1);
    }
    for (uint32_t ray = 0; ray < kRays; ++ray) {
      const float angle = 6 * random.uniform(next++);
      along.insert(along.end(), {0.8f * std::cos(angle), 0.8f * std::sin(angle), -0.6f});
    }
    positions = device->uploadArray(at);
    directions = device->uploadArray(along);
    rayOfSample = device->uploadArray(rays);
    field.reserve(kSamples);
    // The initial table is so close to zero that it would have no visible effect.
    std::vector<float> table = device->read(field.table().values.all());
    for (size_t i = 0; i < table.size(); ++i) table[i] = 2 * random.uniform(1000 + i) - 1;
    device->write(field.table().values.all(), std::span<const float>(table));
  }
  double scalar() {
    const MeshField::Output output = field.forward({kSamples}, positions, directions, rayOfSample, true);
    const std::vector<float> logits = device->read(output.logits.data), colours = device->read(output.colours.data);
    double sum = 0;
    for (uint32_t i = 0; i < kSamples; ++i) {
      sum += double{logitFactors[i]} * logits[output.logits.offset(i, 0)];
      for (uint32_t k = 0; k < 3; ++k) sum += double{colourFactors[3 * i + k]} * colours[output.colours.offset(i, k)];
    }
    return sum;
  }
};

TEST(MeshField, HasGradientsThatAgreeWithFiniteDifferences) {
  Scene scene;
  scene.scalar();
  const Array<float> logits = scene.device->uploadArray(scene.logitFactors),
                     colours = scene.device->uploadArray(scene.colourFactors);
  Array<float> positionGradients = scene.device->array<float>(size_t{3} * kSamples);
  scene.field.backward({kSamples}, scene.positions, logits, Matrix<const float>(colours.all(), 3), true,
                       positionGradients);
  for (ParameterGroup* group : {&scene.field.table(), &scene.field.encoder(), &scene.field.decoder()})
    expectGradientsOfDifferences(*scene.device, *group, [&] { return scene.scalar(); });
  const std::vector<float> gradients = scene.device->read(positionGradients.all());
  double largest = 0;
  for (const float gradient : gradients) largest = std::max(largest, std::abs(double{gradient}));
  for (size_t i = 0; i < gradients.size(); i += 5) {
    constexpr float kStep = 1e-4f;  // small, as the encoding is only piecewise smooth
    const auto scalarAt = [&](float moved) {
      std::vector<float> all = scene.at;
      all[i] = moved;
      scene.device->write(scene.positions.all(), std::span<const float>(all));
      return scene.scalar();
    };
    const double slope = (scalarAt(scene.at[i] + kStep) - scalarAt(scene.at[i] - kStep)) / (2.0 * kStep);
    EXPECT_NEAR(gradients[i], slope, 0.03 * largest) << "coordinate " << i;
  }
}

TEST(MeshField, EncodesTheSameLogitsAsItShades) {
  Scene scene;
  const MeshField::Output output =
      scene.field.forward({kSamples}, scene.positions, scene.directions, scene.rayOfSample, false);
  const std::vector<float> logits = scene.device->read(output.logits.data);
  Array<float> features = scene.device->array<float>(size_t{MeshField::kFeatures} * kSamples);
  scene.field.encode({kSamples}, scene.positions, Matrix<float>(features, MeshField::kFeatures));
  const std::vector<float> encoded = scene.device->read(features.all());
  for (uint32_t i = 0; i < kSamples; ++i)
    EXPECT_EQ(encoded[size_t{MeshField::kFeatures} * i], logits[output.logits.offset(i, 0)]) << i;
}

}  // namespace
}  // namespace tessera

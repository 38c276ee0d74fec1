#include "field/radiance_field.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "base/random.h"

namespace tessera {
namespace {

RadianceFieldShape tinyShape() {
  HashGridOptions grid;
  grid.levels = 3;
  grid.features = 2;
  grid.log2TableSize = 7;  // the finest level is hashed
  grid.baseResolution = 3;
  grid.finestResolution = 12;
  return makeRadianceFieldShape(grid, 16, 1, 2);
}

constexpr uint32_t kCapacity = 24, kSamples = 21, kRays = 4;

// A field on a device, samples, and the scalar Σ a · logDensity + Σ b · colour of its outputs, with random a and b.
struct Scene {
  std::unique_ptr<Device> device;
  RadianceField field;
  Array<float> positions, directions;
  Array<uint32_t> rayOfSample, count;
  std::vector<float> densityFactors, colourFactors;

  explicit Scene(const std::string& kind, uint64_t seed = 1, int threads = 1)
      : device(makeDevice({kind, threads})), field(*device, tinyShape(), seed) {
    const RandomStream random(7, 7);
    uint64_t next = 0;
    std::vector<float> at, along;
    std::vector<uint32_t> rays;
    for (uint32_t i = 0; i < kCapacity; ++i) {
      for (int axis = 0; axis < 3; ++axis) at.push_back(random.uniform(next++));
      rays.push_back(i * kRays / kCapacity);
      densityFactors.push_back(2 * random.uniform(next++) - 1);
      for (int channel = 0; channel < 3; ++channel) colourFactors.push_back(2 * random.uniform(next++) - 1);
    }
    for (uint32_t ray = 0; ray < kRays; ++ray) {
      const float angle = 6 * random.uniform(next++), z = 1.8f * random.uniform(next++) - 0.9f;
      const float across = std::sqrt(1 - z * z);
      along.insert(along.end(), {across * std::cos(angle), across * std::sin(angle), z});
    }
    positions = device->uploadArray(at);
    directions = device->uploadArray(along);
    rayOfSample = device->uploadArray(rays);
    count = device->uploadArray(std::vector<uint32_t>{kSamples});
    field.reserve(kCapacity);
    // The initial table is so close to zero that it would have no visible effect.
    std::vector<float> table = device->read(field.table().values.all());
    for (size_t i = 0; i < table.size(); ++i) table[i] = 2 * random.uniform(1000 + i) - 1;
    device->write(field.table().values.all(), std::span<const float>(table));
  }

  Count samples() const { return {kCapacity, count}; }

  struct Answer {
    std::vector<float> logDensity, colours;
  };
  Answer forward() {
    const RadianceField::Output output = field.forward(samples(), positions, directions, rayOfSample, true);
    Answer answer;
    const std::vector<float> density = device->read(output.logDensity.data), colour = device->read(output.colours.data);
    for (uint32_t i = 0; i < kSamples; ++i) {
      answer.logDensity.push_back(density[output.logDensity.offset(i, 0)]);
      for (int k = 0; k < 3; ++k) answer.colours.push_back(colour[output.colours.offset(i, k)]);
    }
    return answer;
  }
  double scalar() {
    const Answer answer = forward();
    double sum = 0;
    for (size_t i = 0; i < answer.logDensity.size(); ++i) sum += double{densityFactors[i]} * answer.logDensity[i];
    for (size_t i = 0; i < answer.colours.size(); ++i) sum += double{colourFactors[i]} * answer.colours[i];
    return sum;
  }
  void backward() {
    const Array<float> density = device->uploadArray(densityFactors), colour = device->uploadArray(colourFactors);
    field.backward(samples(), positions, density, Matrix<const float>(colour.all(), 3));
  }
  std::vector<ParameterGroup*> groups() { return {&field.table(), &field.densityNetwork(), &field.colourNetwork()}; }
};

double largest(const std::vector<float>& values) {
  double maximum = 0;
  for (const float value : values) maximum = std::max(maximum, std::abs(double{value}));
  return maximum;
}

double largestDifference(const std::vector<float>& a, const std::vector<float>& b) {
  EXPECT_EQ(a.size(), b.size());
  double maximum = 0;
  for (size_t i = 0; i < a.size(); ++i) maximum = std::max(maximum, std::abs(double{a[i]} - b[i]));
  return maximum;
}

TEST(RadianceField, HasGradientsThatAgreeWithFiniteDifferences) {
  Scene scene("reference");
  scene.forward();
  scene.backward();
  for (ParameterGroup* group : scene.groups()) {
    const std::vector<float> gradients = scene.device->read(group->gradients.all());
    const std::vector<float> values = scene.device->read(group->values.all());
    const double scale = largest(gradients);
    ASSERT_GT(scale, 1e-3) << group->name;
    // Tests the 20 largest gradients, and about 20 from the whole range.
    std::vector<size_t> chosen(values.size());
    std::iota(chosen.begin(), chosen.end(), size_t{0});
    std::sort(chosen.begin(), chosen.end(),
              [&](size_t a, size_t b) { return std::abs(gradients[a]) > std::abs(gradients[b]); });
    std::vector<size_t> some(chosen.begin(), chosen.begin() + 20);
    for (size_t i = 20; i < chosen.size(); i += chosen.size() / 20) some.push_back(chosen[i]);
    for (const size_t i : some) {
      constexpr float kStep = 1e-3f;
      const auto at = [&](float value) {
        scene.device->write(group->values.part(i, 1), std::span<const float>(&value, 1));
        return scene.scalar();
      };
      const double slope = (at(values[i] + kStep) - at(values[i] - kStep)) / (2 * kStep);
      at(values[i]);
      EXPECT_NEAR(gradients[i], slope, 0.01 * scale) << group->name << " " << i;
    }
  }
}

TEST(RadianceField, AccumulatesGradients) {
  Scene scene("reference");
  scene.forward();
  scene.backward();
  std::vector<std::vector<float>> once;
  for (ParameterGroup* group : scene.groups()) once.push_back(scene.device->read(group->gradients.all()));
  scene.backward();
  for (size_t g = 0; g < once.size(); ++g) {
    std::vector<float> twice = scene.device->read(scene.groups()[g]->gradients.all());
    for (float& value : twice) value /= 2;
    EXPECT_LE(largestDifference(once[g], twice), 1e-6 * largest(once[g])) << scene.groups()[g]->name;
  }
}

TEST(RadianceField, AgreesOnCpuWithTheReference) {
  Scene reference("reference"), cpu("cpu");
  const Scene::Answer expected = reference.forward(), answer = cpu.forward();
  ASSERT_GT(largest(expected.logDensity), 0.1);
  EXPECT_LE(largestDifference(expected.logDensity, answer.logDensity), 1e-4 * largest(expected.logDensity));
  EXPECT_LE(largestDifference(expected.colours, answer.colours), 1e-4);
  reference.backward();
  cpu.backward();
  for (size_t g = 0; g < reference.groups().size(); ++g) {
    const std::vector<float> expectedGradients = reference.device->read(reference.groups()[g]->gradients.all());
    const std::vector<float> gradients = cpu.device->read(cpu.groups()[g]->gradients.all());
    EXPECT_LE(largestDifference(expectedGradients, gradients), 1e-4 * largest(expectedGradients))
        << reference.groups()[g]->name;
  }
}

TEST(RadianceField, EvaluatesTheSameDensityAloneAndWithColour) {
  Scene scene("cpu");
  const std::vector<float> together = scene.forward().logDensity;
  Array<float> alone = scene.device->array<float>(kCapacity);
  scene.field.density(scene.samples(), scene.positions, Matrix<float>(alone, 1));
  const std::vector<float> values = scene.device->read(alone.all());
  for (uint32_t i = 0; i < kSamples; ++i) EXPECT_EQ(values[i], together[i]);
}

TEST(RadianceField, DependsOnTheViewInColourButNotInDensity) {
  Scene scene("reference");
  const Scene::Answer before = scene.forward();
  std::vector<float> directions = scene.device->read(scene.directions.all());
  for (float& value : directions) value = -value;
  scene.device->write(scene.directions.all(), std::span<const float>(directions));
  const Scene::Answer after = scene.forward();
  EXPECT_EQ(before.logDensity, after.logDensity);
  EXPECT_GT(largestDifference(before.colours, after.colours), 1e-3);
}

TEST(RadianceField, IgnoresSamplesBeyondTheCounter) {
  Scene one("cpu"), other("cpu");
  std::vector<float> positions = other.device->read(other.positions.all());
  for (size_t i = size_t{kSamples} * 3; i < positions.size(); ++i) positions[i] = 0.25f;
  other.device->write(other.positions.all(), std::span<const float>(positions));
  for (Scene* scene : {&one, &other}) {
    scene->forward();
    scene->backward();
  }
  for (size_t g = 0; g < one.groups().size(); ++g) {
    EXPECT_EQ(one.device->read(one.groups()[g]->gradients.all()),
              other.device->read(other.groups()[g]->gradients.all()));
  }
}

TEST(RadianceField, StartsWithTheSameParametersForTheSameSeedOnly) {
  const std::unique_ptr<Device> cpu = makeDevice({"cpu", 2}), reference = makeDevice({"reference", 0});
  RadianceField first(*cpu, tinyShape(), 5), again(*reference, tinyShape(), 5), other(*cpu, tinyShape(), 6);
  const auto groups = [](RadianceField& field) {
    return std::vector{&field.table(), &field.densityNetwork(), &field.colourNetwork()};
  };
  for (int g = 0; g < 3; ++g) {
    const std::vector<float> values = cpu->read(groups(first)[g]->values.all());
    EXPECT_EQ(values, reference->read(groups(again)[g]->values.all()));
    EXPECT_NE(values, cpu->read(groups(other)[g]->values.all()));
    EXPECT_GT(largest(values), 0);
  }
  EXPECT_LE(largest(cpu->read(first.table().values.all())), 1e-4);
}

}  // namespace
}  // namespace tessera

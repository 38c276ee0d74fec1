#include "representations/hash/train/hash_fields.h"

#include <gtest/gtest.h>

#include <cmath>

#include "base/random.h"
#include "compute/lattice.h"
#include "representations/hash/testing/hash_cube.h"

namespace tessera {
namespace {

constexpr uint32_t kSamples = 300, kSlots = 2;

std::vector<float> randomFloats(uint64_t seed, size_t count, float low, float high) {
  const RandomStream random(seed, 0xf1e1d);
  std::vector<float> values(count);
  for (size_t i = 0; i < count; ++i) values[i] = low + (high - low) * random.uniform(i);
  return values;
}

// Fields of two blocks with large random parameters, and samples in both blocks.
struct Fields {
  std::unique_ptr<Device> device = makeDevice({"cpu", 2});
  HashFields fields;
  std::vector<float> positions = randomFloats(1, 3 * kSamples, 0, 1);
  std::vector<uint32_t> slots;

  explicit Fields(const HashConfig& config) : fields(*device, config, kSlots) {
    for (uint32_t slot = 0; slot < kSlots; ++slot) {
      fill(fields.coarse().table(slot), 10 + slot);
      fill(fields.fine(slot), 20 + slot);
    }
    for (uint32_t s = 0; s < kSamples; ++s) slots.push_back(s % 3 == 0 ? 1 : 0);
    fields.reserve(kSamples, 8 * kSamples);
  }
  void fill(ParameterGroup& group, uint64_t seed, float size = 1) {
    device->write(group.values.all(), std::span<const float>(randomFloats(seed, group.values.size(), -size, size)));
  }
  // Returns the features of samples [first, first + count): [count][8].
  std::vector<float> features(uint32_t first = 0, uint32_t count = kSamples) {
    const Array<float> at =
        device->uploadArray(std::vector<float>(positions.begin() + 3 * first, positions.begin() + 3 * (first + count)));
    const Array<uint32_t> in =
        device->uploadArray(std::vector<uint32_t>(slots.begin() + first, slots.begin() + first + count));
    const Matrix<const float> values = fields.forward({{count}, in, at}, false);
    return device->read(values.data.part(0, size_t{8} * count));
  }
};

// Invariant 4 of `hash` (docs/invariants.md): with all weights 1, features are the sum over levels.
TEST(HashFields, AreTheSumOfTheirLevelsWhereAllWeightsAreOne) {
  HashConfig config = smallHashConfig();
  config.attentionVaries = false;
  Fields weighed(config);
  const std::vector<float> logits(weighed.fields.logits().values.size(), 40);
  ASSERT_EQ(logits.size(), 4u);
  weighed.device->write(weighed.fields.logits().values.all(), std::span<const float>(logits));
  config.aggregation = "sum";
  Fields sum(config);
  const std::vector<float> one = weighed.features(), other = sum.features();
  for (size_t i = 0; i < one.size(); ++i) ASSERT_NEAR(one[i], other[i], 1e-6);
}

// Invariant 4 of `hash` (docs/invariants.md): without fine features, only those of the lattice remain; at its corners they
// are the outputs of the coarse network.
TEST(HashFields, AreTheCoarseFeaturesWhereTablesAreEmpty) {
  const HashConfig config = smallHashConfig();
  Fields empty(config);
  for (uint32_t slot = 0; slot < kSlots; ++slot) empty.fill(empty.fields.fine(slot), 0, 0);
  const uint32_t resolution = empty.fields.lattice().voxels;
  for (float& p : empty.positions) {  // move it onto a corner
    const float corner = std::min(std::floor(p * static_cast<float>(resolution)), static_cast<float>(resolution - 1));
    p = (corner + 0.5f) / static_cast<float>(resolution);
  }
  std::fill(empty.slots.begin(), empty.slots.end(), 1);
  const std::vector<float> features = empty.features();
  BlockFieldBatch batch(*empty.device, empty.fields.coarse().shape(), kSamples, false);
  const Array<uint32_t> first = empty.device->uploadArray(std::vector<uint32_t>{0, 0, kSamples});
  const Array<float> positions = empty.device->uploadArray(empty.positions);
  batch.firstOfSlot = first;
  batch.positions = positions;
  empty.fields.coarse().forward(batch, false);
  const std::vector<float> outputs = empty.device->read(batch.outputs.all());
  for (uint32_t s = 0; s < kSamples; ++s) {
    for (uint32_t f = 0; f < 8; ++f) {
      ASSERT_NEAR(features[8 * s + f], outputs[LatticeForward::kColumns * s + f], 1e-5) << s << " " << f;
    }
  }
}

// Invariant 5 of `hash` (docs/invariants.md): a corner is evaluated once, however many samples share it.
TEST(HashFields, AreIndependentOfTheOtherSamplesInTheBatch) {
  Fields fields(smallHashConfig());
  const std::vector<float> together = fields.features();
  EXPECT_LT(fields.fields.texelsDemanded(), 8 * kSamples);
  for (uint32_t s = 0; s < kSamples; s += 7) {
    const std::vector<float> alone = fields.features(s, 1);
    for (uint32_t f = 0; f < 8; ++f) ASSERT_NEAR(alone[f], together[8 * s + f], 1e-6) << s;
  }
}

}  // namespace
}  // namespace tessera

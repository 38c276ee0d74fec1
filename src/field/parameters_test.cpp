#include "field/parameters.h"

#include <gtest/gtest.h>

#include "base/error.h"

namespace tessera {
namespace {

const std::vector<float> kInitial = {1, -2, 3, 0.5f, 0};

class Parameters : public testing::Test {
 protected:
  Parameters() : device_(makeDevice({"reference", 0})) {}

  ParameterGroup group(const std::vector<float>& initial = kInitial) {
    return ParameterGroup(*device_, "group", initial);
  }
  void step(ParameterGroup& group, const std::vector<float>& gradients) {
    device_->write(group.gradients.all(), std::span<const float>(gradients));
    group.step(*device_, Adam());
  }
  Safetensors saved(const ParameterGroup& group, bool withMoments) {
    TensorSet tensors;
    tensors.add(*device_, group, withMoments);
    std::optional<Safetensors> file = decodeSafetensors(tensors.encode({{"format", "test"}}));
    EXPECT_TRUE(file.has_value());
    return std::move(*file);
  }

  std::unique_ptr<Device> device_;
};

TEST_F(Parameters, MoveAgainstTheirGradientsAndClearThem) {
  ParameterGroup trained = group();
  step(trained, {1, -1, 0.25f, -4, 0});
  const std::vector<float> values = device_->read(trained.values.all());
  // The length of the first step of Adam is the learning rate, whatever the gradient.
  const std::vector<float> expected = {0.99f, -1.99f, 2.99f, 0.51f, 0};
  for (size_t i = 0; i < values.size(); ++i) EXPECT_NEAR(values[i], expected[i], 1e-5);
  EXPECT_EQ(device_->read(trained.gradients.all()), std::vector<float>(5, 0.0f));
}

TEST_F(Parameters, ContinueTrainingExactlyAfterLoading) {
  ParameterGroup unbroken = group(), resumed = group(std::vector<float>(5));
  step(unbroken, {1, 2, 3, 4, 5});
  step(unbroken, {-1, 2, 0, 1, 5});
  loadGroup(*device_, "test", saved(unbroken, true), resumed);
  for (ParameterGroup* each : {&unbroken, &resumed}) step(*each, {0.5f, 0.25f, -3, 2, 1});
  EXPECT_EQ(device_->read(unbroken.values.all()), device_->read(resumed.values.all()));
  EXPECT_EQ(device_->read(unbroken.secondMoments.all()), device_->read(resumed.secondMoments.all()));
  EXPECT_EQ(device_->read(resumed.counts.all()), std::vector<uint32_t>(5, 3));
}

TEST_F(Parameters, LoadWithoutMomentsForRendering) {
  ParameterGroup trained = group(), loaded = group(std::vector<float>(5));
  step(trained, {1, 2, 3, 4, 5});
  const Safetensors file = saved(trained, false);
  EXPECT_EQ(file.tensors.size(), 1u);
  EXPECT_EQ(file.metadata.at("format"), "test");
  loadGroup(*device_, "test", file, loaded);
  EXPECT_EQ(device_->read(trained.values.all()), device_->read(loaded.values.all()));
}

TEST_F(Parameters, RejectTensorsOfAnotherSizeByName) {
  ParameterGroup larger = group(std::vector<float>(6));
  try {
    loadGroup(*device_, "model/step-1.safetensors", saved(group(), true), larger);
    FAIL() << "no error";
  } catch (const Error& error) {
    EXPECT_EQ(error.subject(), "model/step-1.safetensors");
    EXPECT_EQ(error.place(), "tensor group");
    EXPECT_NE(error.reason().find("5 values"), std::string::npos) << error.what();
  }
}

TEST_F(Parameters, RejectFilesThatLackTheirTensorOrAMoment) {
  ParameterGroup target = group();
  EXPECT_THROW(loadGroup(*device_, "file", saved(ParameterGroup(*device_, "other", kInitial), true), target), Error);
  TensorSet partial;
  partial.add("group", kInitial);
  partial.add("group.m1", kInitial);
  const std::optional<Safetensors> file = decodeSafetensors(partial.encode({}));
  ASSERT_TRUE(file);
  EXPECT_THROW(loadGroup(*device_, "file", *file, target), Error);
}

TEST_F(Parameters, RejectTensorsOfAnotherType) {
  TensorSet integers;
  integers.add("group", std::vector<uint32_t>{1, 2, 3, 4, 5});
  const std::optional<Safetensors> file = decodeSafetensors(integers.encode({}));
  ASSERT_TRUE(file);
  ParameterGroup target = group();
  EXPECT_THROW(loadGroup(*device_, "file", *file, target), Error);
}

}  // namespace
}  // namespace tessera

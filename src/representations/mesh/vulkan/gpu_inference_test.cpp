#include "representations/mesh/vulkan/gpu_inference.h"

#include <gtest/gtest.h>

#include "gpu/testing/test_context.h"
#include "representations/mesh/testing/random_mesh.h"

namespace tessera {
namespace {

class GpuInferenceTest : public testing::Test {
 protected:
  void SetUp() override {
    context_ = openForTest();
    SKIP_WITHOUT_VULKAN(context_);
    stream_ = std::make_shared<GpuStream>(context_);
  }
  void TearDown() override { EXPECT_EQ(GpuContext::validationMessages(), 0); }

  void infer(GpuInference& inference, const MeshContent& content) {
    ASSERT_TRUE(inference.fits(content));
    inference.infer(content, GpuMeshContent(stream_, content));
  }

  std::shared_ptr<const GpuContext> context_;
  std::shared_ptr<GpuStream> stream_;
};

TEST_F(GpuInferenceTest, KeepsEncodersWithinItsBudget) {
  const MeshContent first = tiles_test::inferredMeshContent(1), second = tiles_test::inferredMeshContent(2);
  GpuInference inference(stream_);
  infer(inference, first);
  const uint64_t one = inference.memoryBytes();
  EXPECT_GE(one, 2 * first.encoders[0]->encoder.table.size());
  infer(inference, first);  // with the encoder that is there
  EXPECT_EQ(inference.memoryBytes(), one);
  infer(inference, second);
  EXPECT_EQ(inference.memoryBytes(), 2 * one);
  EXPECT_EQ(first.encoders[0].use_count(), 2);  // in main memory, too

  inference.setBudget(one + one / 2);
  EXPECT_EQ(inference.memoryBytes(), one);
  EXPECT_EQ(first.encoders[0].use_count(), 1);  // the one that was not used for longer has given way
  EXPECT_EQ(second.encoders[0].use_count(), 2);
  infer(inference, first);
  EXPECT_EQ(inference.memoryBytes(), one);
  EXPECT_EQ(second.encoders[0].use_count(), 1);
}

TEST_F(GpuInferenceTest, RefusesAnEncoderThatExceedsItsBudget) {
  GpuInference inference(stream_);
  inference.setBudget(1000);
  EXPECT_FALSE(inference.fits(tiles_test::inferredMeshContent(1)));
  EXPECT_TRUE(inference.fits(tiles_test::randomMeshContent(1)));
}

}  // namespace
}  // namespace tessera

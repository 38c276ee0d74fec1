#include "representations/mesh/train/config.h"

#include <gtest/gtest.h>

#include "base/error.h"

namespace tessera {
namespace {

TEST(MeshConfig, HasPresetsThatCanBeTrained) {
  for (const char* name : {"cpu", "paper"}) {
    MeshConfig config = MeshConfig::ofPreset(name);
    EXPECT_NO_THROW(config.check());
    EXPECT_EQ(config.preset, name);
  }
  EXPECT_THROW(MeshConfig::ofPreset("gpu"), Error);
}

TEST(MeshConfig, KnowsTwoWaysToTreatWhatMoves) {
  MeshConfig config;
  EXPECT_FALSE(config.leavesTransientsOut());
  config.transient = "auto";
  EXPECT_NO_THROW(config.check());
  EXPECT_TRUE(config.leavesTransientsOut());
  config.transient = "always";
  EXPECT_THROW(config.check(), Error);
}

TEST(MeshConfig, HasThePapersSizesInThePaperPreset) {
  const MeshConfig paper = MeshConfig::ofPreset("paper");
  const MlpShape encoder = paper.shape().encoder;
  EXPECT_EQ(encoder.inputs, 32);
  EXPECT_EQ(encoder.width, 64);
  EXPECT_EQ(encoder.hiddenLayers, 3);
  EXPECT_EQ(encoder.outputs, 8);
  EXPECT_EQ(paper.levels(), 5u);
  const MeshPart block{"block_0_0", 0, {}, {1, 1, 1}};
  EXPECT_EQ(paper.domain(block, 0).grids[0].resolution, 128u);
  EXPECT_EQ(paper.domain(block, 4).grids[0].resolution, 8u);
  EXPECT_EQ(paper.stepsBeforeFinalStage(80000), 80000);
  EXPECT_FALSE(paper.coarseCells || paper.surfaceStart || paper.randomBackground || paper.exposure);
  EXPECT_TRUE(paper.everyCell && paper.opaqueLoss);
  EXPECT_EQ(paper.distortionWeight + paper.throughShare + paper.droppedShare + paper.networkL2, 0);
  EXPECT_EQ(paper.backgroundBlock, "none");
  EXPECT_EQ(paper.enoughPhotos, 0);
  EXPECT_EQ(paper.transient, "none");
}

}  // namespace
}  // namespace tessera

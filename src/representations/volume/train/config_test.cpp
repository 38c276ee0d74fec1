#include "representations/volume/train/config.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "base/error.h"

namespace tessera {
namespace {

TEST(VolumeConfig, HasPresetsThatCanBeTrained) {
  for (const char* name : {"cpu", "paper"}) {
    VolumeConfig config = VolumeConfig::ofPreset(name);
    EXPECT_NO_THROW(config.check());
    EXPECT_EQ(config.preset, name);
  }
  const VirtualGrid paper = VolumeConfig::ofPreset("paper").virtualGrid();
  EXPECT_EQ(paper.voxels, 512u);
  EXPECT_EQ(paper.planes, 2048u);
  EXPECT_THROW(VolumeConfig::ofPreset("gpu"), Error);
}

// City-on-Web, section 5 (implementation details), and MERF.
TEST(VolumeConfig, HasThePapersScheduleBorderBlocksAndLossesInThePresetPaper) {
  const VolumeConfig paper = VolumeConfig::ofPreset("paper");
  const RateSchedule schedule = paper.rateSchedule();
  constexpr int64_t kSteps = 50000;
  EXPECT_DOUBLE_EQ(schedule.at(schedule.warmUpSteps, kSteps), 1e-2 * std::pow(0.1, schedule.warmUpSteps / 5e4));
  EXPECT_NEAR(schedule.at(kSteps / 2, kSteps), 1e-2 * std::sqrt(0.1), 1e-9);
  EXPECT_DOUBLE_EQ(schedule.at(kSteps, kSteps), 1e-3);
  EXPECT_EQ(paper.firstRays, 16384);
  EXPECT_EQ(paper.maxRays, 16384);
  EXPECT_EQ(paper.backgroundBlockMode(), BackgroundBlockMode::border);
  EXPECT_EQ(paper.attributeShape().network.hiddenLayers, 3);
  EXPECT_EQ(paper.attributeShape().network.width, 64);
  EXPECT_EQ(paper.loss, "charbonnier");
  for (const double weight :
       {paper.s3imWeight, paper.interlevelWeight, paper.distortionWeight, paper.sparsityWeight, paper.opacityWeight}) {
    EXPECT_GT(weight, 0);
  }
}

TEST(VolumeConfig, HasNothingThatThePaperLacksInThePresetPaper) {
  const VolumeConfig paper = VolumeConfig::ofPreset("paper");
  for (const double addition :
       {paper.networkL2, paper.fullGradientDistance, paper.sparseDepthRayFraction, paper.uniformSampleFraction}) {
    EXPECT_EQ(addition, 0);
  }
  EXPECT_EQ(paper.deferredLearningRateFactor, 1);
  for (const bool addition : {paper.nearFromSparseDepth, paper.exposure, paper.blocksOnly}) EXPECT_FALSE(addition);
}

// Operations index activations with 31 bits; VolumeTrainer reserves half as many texels again for steps that need more.
TEST(VolumeConfig, HasBatchesThatOperationsCanIndexInThePresetPaper) {
  const VolumeConfig paper = VolumeConfig::ofPreset("paper");
  const double texels = 1.5 * paper.texelsPerStep + VirtualGrid::kCorners * paper.sparsityPoints;
  EXPECT_LT(texels * static_cast<double>(paper.attributeShape().network.activationsPerSample()), std::pow(2.0, 31));
}

TEST(VolumeConfig, RoundTripsThroughItsFile) {
  VolumeConfig config = VolumeConfig::ofPreset("paper"), read;
  config.backgroundBlock = "none";
  config.opacityWeight = 0.25;
  const fs::path path = fs::temp_directory_path() / "tessera-volume-config.toml";
  writeFileAtomically(path, configToToml(config.fields()));
  configFromToml(read.fields(), path);
  fs::remove(path);
  const std::vector<ConfigField> before = config.fields(), after = read.fields();
  for (size_t i = 0; i < before.size(); ++i) EXPECT_EQ(configValueText(before[i]), configValueText(after[i]));
}

TEST(VolumeConfig, RejectsSettingsWithWhichNoModelCanBeBuilt) {
  const std::function<void(VolumeConfig&)> wrongs[] = {
      [](VolumeConfig& c) { c.backgroundBlock = "everywhere"; },
      [](VolumeConfig& c) { c.preset = "huge"; },
      [](VolumeConfig& c) { c.near = 1.5; },
      [](VolumeConfig& c) { c.voxels = 100; },
      [](VolumeConfig& c) { c.planes = 4; },
      [](VolumeConfig& c) { c.width = 48; },
      [](VolumeConfig& c) { c.samples = 1; },
      [](VolumeConfig& c) { c.firstRays = c.maxRays + 1; },
      [](VolumeConfig& c) { c.uniformSampleFraction = 1.5; },
      [](VolumeConfig& c) { c.lodUniformSampleFraction = -0.1; },
      [](VolumeConfig& c) { c.cullEnd = c.cullBegin / 2; },
      [](VolumeConfig& c) { c.learningRate = 0; },
      [](VolumeConfig& c) { c.gridFinest = 8; },
  };
  for (size_t i = 0; i < std::size(wrongs); ++i) {
    VolumeConfig config;
    wrongs[i](config);
    EXPECT_THROW(config.check(), Error) << i;
  }
}

TEST(VolumeConfig, RejectsMisspeltSettings) {
  VolumeConfig config;
  EXPECT_THROW(setConfigField(config.fields(), "voxel=64"), Error);
  setConfigField(config.fields(), "voxels=64");
  EXPECT_EQ(config.voxels, 64);
}

}  // namespace
}  // namespace tessera

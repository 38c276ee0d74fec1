#include "representations/volume/train/config.h"

#include <gtest/gtest.h>

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

TEST(VolumeConfig, RoundTripsThroughItsFile) {
  VolumeConfig config = VolumeConfig::ofPreset("paper"), read;
  config.backgroundBlock = "border";
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

#include "representations/hash/train/config.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "base/error.h"
#include "base/file.h"
#include "field/radiance_field.h"

namespace tessera {
namespace {

TEST(HashConfig, HasPresetsThatCanBeTrained) {
  for (const char* name : {"cpu", "paper"}) {
    HashConfig config = HashConfig::ofPreset(name);
    EXPECT_NO_THROW(config.check());
    EXPECT_EQ(config.preset, name);
  }
  EXPECT_THROW(HashConfig::ofPreset("gpu"), Error);
}

TEST(HashConfig, HasThePapersTablesInThePaperPreset) {
  const HashConfig paper = HashConfig::ofPreset("paper");
  const HashGrid coarse = paper.coarseShape().grid, fine = paper.fineGrid();
  // Invariant 1 of `hash` (docs/invariants.md): resolutions 16 to 512 in six levels of four features; the finest three
  // are hashed.
  EXPECT_EQ(coarse.columns(), 24u);
  EXPECT_EQ(coarse.entries(), 6590464u);
  ASSERT_EQ(fine.levels.size(), 2u);
  EXPECT_EQ(fine.levels[0].resolution, 1024u);
  EXPECT_EQ(fine.levels[1].resolution, 2048u);
  // Invariant 2: a fiftieth of the lattice with 8 features and 4 weights, and the fine tables, have 99.3 million
  // values.
  EXPECT_EQ(fine.parameters(), size_t{2} * 8 << 22);
  EXPECT_NEAR(12 * 0.02 * std::pow(512, 3) + static_cast<double>(fine.parameters()), 99.32e6, 0.01e6);
  // Invariant 3: the longest step is half the diagonal of a cell of the lattice, whose edge is 4 / 512 long.
  EXPECT_NEAR(paper.longestStep() * 4, 2 * std::sqrt(3) / 512, 1e-6);
}

// Invariant 12 of `hash` (docs/invariants.md); schedule_test.cpp and hash_trainer_test.cpp test the schedules
// themselves.
TEST(HashConfig, HasThePapersSchedulesInThePaperPreset) {
  const HashConfig paper = HashConfig::ofPreset("paper");
  EXPECT_EQ(paper.learningRate, 0.01);
  EXPECT_EQ(paper.learningRateSchedule, "linear");
  EXPECT_EQ(paper.warmupSteps, 1000);
  EXPECT_EQ(paper.lossWarmupFraction, 0.5);
  // Relative to r² / 2, the paper's Huber loss for small r; here it is r² / 2δ.
  EXPECT_NEAR(*paper.distortionWeight * paper.lossParameter, 0.01, 1e-12);
}

// The paper states a saving of "over 90 %".
TEST(HashConfig, TakesATenthOfTheArithmeticOfANetworkForEachSample) {
  const HashConfig paper = HashConfig::ofPreset("paper"), cpu;
  EXPECT_EQ(paper.multiplyAccumulates(), 8u * 12 + 2 * 8 * 8 + 2 * 8);
  const RadianceFieldShape shape = makeRadianceFieldShape({}, 64, 1, 2);
  const size_t field = densityMultiplyAccumulates(shape) + colourMultiplyAccumulates(shape);
  EXPECT_LT(paper.multiplyAccumulates(), 0.1 * static_cast<double>(field));
  EXPECT_LT(cpu.multiplyAccumulates(), 0.1 * static_cast<double>(field));
}

TEST(HashConfig, IsReadBackFromItsFile) {
  HashConfig config = HashConfig::ofPreset("paper"), read;
  config.backgroundBlock = "none";
  config.depthWeight = 0.25;
  const fs::path path = fs::temp_directory_path() / "tessera-hash-config.toml";
  writeFileAtomically(path, configToToml(config.fields()));
  configFromToml(read.fields(), path);
  fs::remove(path);
  const std::vector<ConfigField> before = config.fields(), after = read.fields();
  for (size_t i = 0; i < before.size(); ++i) EXPECT_EQ(configValueText(before[i]), configValueText(after[i]));
}

TEST(HashConfig, RejectsInvalidSettings) {
  const std::function<void(HashConfig&)> wrongs[] = {
      [](HashConfig& c) { c.backgroundBlock = "everywhere"; },
      [](HashConfig& c) { c.preset = "huge"; },
      [](HashConfig& c) { c.lattice = 100; },
      [](HashConfig& c) { c.near = 1.5; },
      [](HashConfig& c) { c.fineLevels = 5; },
      [](HashConfig& c) { c.aggregation = "vote"; },
      [](HashConfig& c) { c.attention = "none"; },
      [](HashConfig& c) { c.background = "white"; },
      [](HashConfig& c) { c.width = 48; },
      [](HashConfig& c) { c.occupancyResolution = 30; },
      [](HashConfig& c) { c.coarseBase = 4096; },
      [](HashConfig& c) { c.learningRateSchedule = "steep"; },
      [](HashConfig& c) { c.directionHidden = 8; },
      [](HashConfig& c) { c.directionWidth = 128; },  // with two hidden layers
      [](HashConfig& c) { c.directionHidden = 5; },   // with width 64
  };
  for (const auto& wrong : wrongs) {
    HashConfig config;
    wrong(config);
    EXPECT_THROW(config.check(), Error);
  }
}

}  // namespace
}  // namespace tessera

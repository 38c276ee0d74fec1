// Tests that the committed scene of `volume` can be read, which a change of the format would break.
#include "golden/golden_volume.h"

#include "golden_scene_test.h"
#include "representations/volume/content/volume_payload.h"
#include "representations/volume/cpu/volume_drawer.h"

namespace tessera {
namespace {

const fs::path kVolumeScene = TESSERA_GOLDEN_VOLUME;

void expectSame(const VolumeContent& a, const VolumeContent& b) {
  EXPECT_EQ(a.featureRange, b.featureRange);
  EXPECT_EQ(a.densityRange, b.densityRange);
  EXPECT_EQ(a.stepsPerTexel, b.stepsPerTexel);
  ASSERT_EQ(a.network.size(), b.network.size());
  for (size_t i = 0; i < a.network.size(); ++i) {
    EXPECT_EQ(a.network[i].inputs, b.network[i].inputs);
    EXPECT_EQ(a.network[i].outputs, b.network[i].outputs);
    EXPECT_EQ(a.network[i].weights, b.network[i].weights);
    EXPECT_EQ(a.network[i].biases, b.network[i].biases);
  }
  ASSERT_EQ(a.parts.size(), b.parts.size());
  for (size_t i = 0; i < a.parts.size(); ++i) {
    EXPECT_EQ(a.parts[i].centre, b.parts[i].centre);
    EXPECT_EQ(a.parts[i].scale, b.parts[i].scale);
    EXPECT_EQ(a.parts[i].low, b.parts[i].low);
    EXPECT_EQ(a.parts[i].high, b.parts[i].high);
    EXPECT_EQ(a.parts[i].contracted, b.parts[i].contracted);
    EXPECT_EQ(a.parts[i].backgroundBlock, b.parts[i].backgroundBlock);
    EXPECT_EQ(a.parts[i].voxels, b.parts[i].voxels);
    EXPECT_EQ(a.parts[i].planes, b.parts[i].planes);
    EXPECT_EQ(a.parts[i].macroblocks, b.parts[i].macroblocks);
    EXPECT_EQ(a.parts[i].voxelBytes, b.parts[i].voxelBytes);
    EXPECT_EQ(a.parts[i].planeBytes, b.parts[i].planeBytes);
    EXPECT_EQ(a.parts[i].distances, b.parts[i].distances);
  }
}

TEST(GoldenVolume, MatchesTheExpectedSums) {
  const nlohmann::ordered_json expected = readGoldenJson(kVolumeScene / "sums.json");
  EXPECT_EQ(expected.size(), 5u);
  forEachGoldenContent<VolumeContent>(
      kVolumeScene, volumeCodec(), [&](const auto& uri, const auto&, const VolumeContent& volume) {
        const auto& sums = expected.at(uri);
        ASSERT_EQ(volume.parts.size(), sums.size());
        for (size_t i = 0; i < sums.size(); ++i) {
          EXPECT_EQ(golden::toJson(golden::computeSums(volume.parts[i])), sums[i]) << uri << " part " << i;
        }
      });
}

TEST(GoldenVolume, MatchesItsGenerator) {
  const golden::Scene<VolumeContent> scene = golden::makeVolumeScene();
  const Tileset tileset = readTileset(kVolumeScene);
  EXPECT_EQ(tileset.worldFromScene.matrix(), scene.tileset.worldFromScene.matrix());
  EXPECT_EQ(tileset.sourceFromWorld, scene.tileset.sourceFromWorld);
  EXPECT_EQ(tileset.background, scene.tileset.background);
  EXPECT_EQ(tileset.georeference->latitude, scene.tileset.georeference->latitude);
  forEachGoldenContent<VolumeContent>(
      kVolumeScene, volumeCodec(),
      [&](const auto&, const auto& name, const VolumeContent& volume) { expectSame(volume, scene.contents.at(name)); });
}

TEST(GoldenVolume, IsTheSameWhenItIsWrittenAgain) {
  forEachGoldenContent<VolumeContent>(kVolumeScene, volumeCodec(),
                                      [&](const auto&, const auto&, const VolumeContent& volume) {
                                        std::string reason;
                                        const auto again = decodeVolume(encodeVolume(volume), reason);
                                        ASSERT_TRUE(again) << reason;
                                        expectSame(volume, *again);
                                      });
}

TEST(GoldenVolume, RendersItsRaysAsTheDefinitionSays) {
  expectRaysAsDefined<VolumeContent>(kVolumeScene, volumeCodec());
}

// Samples along a vertical line through a building, whose roof must be found at its height.
TEST(GoldenVolume, HasOccupiedCellsAtItsRoofs) {
  const golden::Scene<VolumeContent> scene = golden::makeVolumeScene();
  const VolumePart& part = scene.contents.at("0_0").parts[0];
  const uint32_t cells = part.planes / VolumePart::kDistanceCell;
  const auto at = [&](double x, double y, double z) {  // local, in [-1,1]
    const auto cell = [&](double c) { return static_cast<size_t>((c + 1) / 2 * cells); };
    return part.distances[cell(x) + cells * (cell(y) + cells * cell(z))];
  };
  EXPECT_EQ(at(0, 0, 0.45), 0);
  EXPECT_GE(at(0, 0, 0.9), 1);
  EXPECT_GE(at(-0.8, 0.8, 0.9), 2);
  EXPECT_EQ(at(-0.8, 0.8, -0.45), 0);
}

}  // namespace
}  // namespace tessera

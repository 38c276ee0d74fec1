#include "export/merf.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>

#include "base/error.h"
#include "export/merf_layout.h"
#include "export/testing/merf_viewer.h"
#include "raymarch/content/occupancy_pyramid.h"
#include "representations/volume/content/volume_payload.h"
#include "representations/volume/cpu/volume_shading.h"
#include "representations/volume/testing/reference_volume.h"
#include "representations/volume/testing/test_volume_content.h"
#include "tiles/scene_folder.h"

namespace tessera {
namespace {

// Converts a position q of a block to the viewer's axes.
ViewerPlace inViewer(const Triple<double>& q) {
  return {q[1], q[2], q[0]};
}

VolumeContent oneBlock(uint32_t voxels = 32, uint32_t planes = 64, double filled = 0.3) {
  VolumePart part;
  part.contracted = true;
  part.voxels = voxels;
  part.planes = planes;
  part.low = {-1e6f, -1e6f, -1e6f};
  part.high = {1e6f, 1e6f, 1e6f};
  makeVolume(part, smoothVolume(voxels + planes, filled));
  part.distances = chebyshevDistances(occupancyFromDistances(part.distances, planes / VolumePart::kDistanceCell));
  return makeVolumeContent({part}, randomNetwork(5));
}

// A block of a resolution that the viewer can load and that is quick to make.
VolumeContent largeBlock() {
  VolumePart part;
  part.contracted = true;
  part.scale = {2, 2, 2};
  part.low = {-1e6f, -1e6f, -1e6f};
  part.high = {1e6f, 1e6f, 1e6f};
  part.voxels = 32;
  part.planes = 512;
  part.macroblocks.assign(64, VolumePart::kEmpty);
  for (uint32_t m = 0; m < 32; ++m) part.macroblocks[2 * m] = m;
  for (uint32_t i = 0; i < 32 * VolumePart::kMacroblockBytes; ++i) part.voxelBytes.push_back((i + i / 97) % 256);
  for (size_t plane = 0; plane < 3; ++plane) {
    part.planeBytes[plane].resize(size_t{512} * 512 * VolumePart::kAttributes);
    for (size_t i = 0; i < part.planeBytes[plane].size(); ++i) part.planeBytes[plane][i] = (i / 4096 + plane) % 256;
  }
  part.distances.assign(64 * 64 * 64, 0);
  return makeVolumeContent({part}, randomNetwork(5));
}

class Merf : public testing::Test {
 protected:
  void SetUp() override {
    root_ = fs::temp_directory_path() / ("tessera-merf-" + std::to_string(::getpid()));
    fs::remove_all(root_);
    fs::create_directories(root_ / "out");
  }
  void TearDown() override { fs::remove_all(root_); }

  MerfViewer viewed(const VolumeContent& content) const {
    writeMerf(content, root_ / "out");
    return MerfViewer(root_ / "out");
  }

  static Tileset makeTileset(const VolumeContent& content) {
    Tileset tileset;
    tileset.representation = "volume";
    tileset.geometricError = 10;
    Tile tile;
    tile.cells = tileset.allCells();
    tile.contents.resize(1);
    tile.contents[0].cells = tile.cells;
    for (int a = 0; a < 3; ++a) {
      tile.box.low[a] = content.parts[0].low[a];
      tile.box.high[a] = content.parts[0].high[a];
    }
    tile.contents[0].box = tile.box;
    tileset.tiles.push_back(tile);
    return tileset;
  }
  fs::path writeScene(const VolumeContent& content, Tileset tileset) const {
    const SceneFolderWriter writer(root_ / "scene");
    tileset.tiles[0].contents[0].uri = writer.addContent(0, "block", encodeVolume(content, 0));
    for (TileContent& more : tileset.tiles[0].contents) {
      if (more.uri.empty()) more.uri = writer.addContent(0, "more", encodeVolume(content, 0));
    }
    writer.commit(tileset);
    return root_ / "scene";
  }
  fs::path writeScene(const VolumeContent& content) const { return writeScene(content, makeTileset(content)); }

  fs::path root_;
};

struct Agreement {
  int seen = 0, passedOver = 0;
};

// Compares the lookups at a position in the block's domain. Within half a voxel of a lower side, the viewer's own
// lookup is wrong (it clamps to the macroblock after rounding down past the grid): there, only whether something is
// found is compared.
void compareAt(const VolumeContent& content, const MerfViewer& viewer, const Triple<double>& q, Agreement& agreement) {
  const VolumePart& part = content.parts[0];
  const Triple<double> p = {(q[0] + 2) / 4, (q[1] + 2) / 4, (q[2] + 2) / 4};
  double expected[8];
  const bool seen = referenceSums(content, part, p, expected);
  const auto sums = viewer.lookUp(inViewer(q));
  ASSERT_EQ(sums.has_value(), seen) << q[0] << " " << q[1] << " " << q[2];
  (seen ? agreement.seen : agreement.passedOver) += 1;
  if (!seen || *std::min_element(p.begin(), p.end()) * part.voxels < 0.5) return;
  // The viewer's density is per unit of its own length.
  EXPECT_NEAR(std::exp((*sums)[0] - 1), std::exp(expected[0] - 1) * part.scale[0], 1e-7 * std::exp(expected[0]));
  for (int k = 1; k < 8; ++k) EXPECT_NEAR((*sums)[k], expected[k], 1e-9) << k;
}

TEST_F(Merf, HoldsWhatIsReadFromTheBakedBlockEverywhere) {
  // 72 texels: an odd number of cells, so that coarser grids reach beyond the domain.
  for (const auto& [voxels, planes, scale] : {std::tuple{32u, 64u, 1.0f}, {40u, 72u, 2.5f}, {64u, 128u, 1.0f}}) {
    VolumeContent content = oneBlock(voxels, planes);
    content.parts[0].scale = {scale, scale, scale};
    const MerfViewer viewer = viewed(content);
    const RandomStream random(7, voxels);
    Agreement agreement;
    uint64_t next = 0;
    for (int i = 0; i < 4000; ++i) {
      Triple<double> q;
      for (double& x : q) x = 4 * random.uniformDouble(next++) - 2;
      // A third of the positions lie beside the borders of macroblocks, a third beside those of the domain, along one
      // axis.
      double& x = q[random.below(next++, 3)];
      const double side = random.below(next++, 2) ? 1 : -1;
      if (i % 3 == 1) x = -2 + (8.0 * random.below(next++, voxels / 8) + 0.5) * 4 / voxels + 1e-6 * side;
      if (i % 3 == 2) x = side * (2 - 1e-9);
      compareAt(content, viewer, q, agreement);
      if (HasFatalFailure()) return;
    }
    EXPECT_GT(agreement.seen, 400);
    EXPECT_GT(agreement.passedOver, 400);
  }
}

TEST_F(Merf, HasOccupancyOfEveryFactorAboveTheFinest) {
  const VolumeContent content = oneBlock(32, 256, 0.02);
  const MerfViewer viewer = viewed(content);
  const RandomStream random(8, 0);
  std::array<int, 5> occupied{};
  for (uint64_t i = 0; i < 3000; ++i) {
    ViewerPlace z;
    for (int a = 0; a < 3; ++a) z[a] = 4 * random.uniformDouble(3 * i + a) - 2;
    bool finer = false;
    for (size_t grid = 0; grid < occupied.size(); ++grid) {
      const bool here = viewer.occupied(grid, z);
      EXPECT_TRUE(here || !finer) << grid;
      finer = here;
      occupied[grid] += here;
    }
  }
  EXPECT_GT(occupied[0], 20);
  // The test content consists of cubes of 16 texels.
  for (size_t grid = 2; grid < occupied.size(); ++grid) EXPECT_GT(occupied[grid], occupied[grid - 1]);
}

TEST_F(Merf, HasAnEquivalentNetworkForTheViewersDirections) {
  const VolumeContent content = oneBlock();
  const MerfViewer viewer = viewed(content);
  const DeferredShader shader(content.network);
  const RandomStream random(9, 0);
  uint64_t next = 0;
  double minimum = 1, maximum = 0;
  for (int i = 0; i < 200; ++i) {
    ContentComposite composite;
    for (float& value : composite.values) value = random.uniform(next++);
    Vec3d d;
    for (int a = 0; a < 3; ++a) d[a] = 2 * random.uniformDouble(next++) - 1;
    d.normalize();
    const std::array<float, 3> expected = shader.shade(composite, encodeDirection(d));
    const float* v = composite.values;
    const std::array<double, 3> got =
        viewer.network({v[0], v[1], v[2]}, {v[3], v[4], v[5], v[6]}, inViewer({d[0], d[1], d[2]}));
    // The viewer treats inputs below 0.1 / 255 as 0.
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(got[c], expected[c], 5e-4);
    minimum = std::min<double>(minimum, expected[0]);
    maximum = std::max<double>(maximum, expected[0]);
  }
  EXPECT_GT(maximum - minimum, 0.1);
}

TEST_F(Merf, PutsMacroblocksIntoTheSmallestAtlasOfTheFewestSlices) {
  using Atlas = std::array<uint32_t, 3>;
  EXPECT_EQ(merfAtlas(1), (Atlas{1, 1, 1}));
  EXPECT_EQ(merfAtlas(227), (Atlas{227, 1, 1}));
  EXPECT_EQ(merfAtlas(228), (Atlas{114, 2, 1}));
  EXPECT_EQ(merfAtlas(227 * 227 * 227), (Atlas{227, 227, 227}));
  for (const uint32_t stored : {2u, 229u, 1021u, 5003u, 40009u, 60000u, 367236u}) {
    const Atlas atlas = merfAtlas(stored);
    EXPECT_GE(atlas[0] * atlas[1] * atlas[2], stored);
    EXPECT_LE(atlas[0] * atlas[1] * atlas[2], stored + stored / 100 + 1);
    EXPECT_TRUE(227 >= atlas[0] && atlas[0] >= atlas[1] && atlas[1] >= atlas[2]) << stored;
  }
}

TEST_F(Merf, ExportsTheFolderOfAScene) {
  const VolumeContent content = largeBlock();
  fs::remove(root_ / "out");
  const MerfExport exported = exportMerf(writeScene(content), root_ / "out");
  EXPECT_EQ(exported.macroblocks, content.parts[0].storedMacroblocks());
  EXPECT_EQ(exported.near, 0.025);
  uint64_t bytes = 0, files = 0;
  for (const fs::directory_entry& entry : fs::directory_iterator(root_ / "out")) {
    bytes += entry.file_size();
    ++files;
  }
  EXPECT_EQ(exported.bytesOnDisk, bytes);
  EXPECT_EQ(files, 6 + 2 * exported.slices + 1 + 5 + 1);
  const MerfViewer viewer(root_ / "out");
  Agreement agreement;
  for (double x = -1.9; x < 2; x += 0.4) compareAt(content, viewer, {x, 0.1 - x / 3, x / 2}, agreement);
  EXPECT_GT(agreement.seen, 0);
  EXPECT_GT(agreement.passedOver, 0);
  // Exports again over the older export, which had more slices.
  writeFileAtomically(root_ / "out/sparse_grid_features_999.png", std::string_view("old"));
  exportMerf(root_ / "scene", root_ / "out");
  EXPECT_FALSE(fs::exists(root_ / "out/sparse_grid_features_999.png"));
  EXPECT_TRUE(fs::exists(root_ / "out/scene_params.json"));
}

TEST_F(Merf, SaysWhyASceneCannotBeExportedAndWhatToTrain) {
  const VolumeContent good = oneBlock();
  const auto refused = [&](const fs::path& scene, const std::string& reason, const std::string& remedy) {
    try {
      exportMerf(scene, root_ / "never");
      ADD_FAILURE() << "was taken: " << reason;
    } catch (const Error& error) {
      EXPECT_NE(error.reason().find(reason), std::string::npos) << error.what();
      EXPECT_NE(error.remedy().find(remedy), std::string::npos) << error.what();
    }
    EXPECT_FALSE(fs::exists(root_ / "never"));
  };
  const std::string train = "--blocks 1x1 --set background_block=border";

  Tileset tileset = makeTileset(good);
  tileset.columns = 3;
  tileset.rows = 2;
  tileset.tiles[0].cells = tileset.tiles[0].contents[0].cells = tileset.allCells();
  refused(writeScene(good, tileset), "has 3 by 2 blocks", train);
  tileset = makeTileset(good);
  tileset.tiles[0].contents.push_back(tileset.tiles[0].contents[0]);
  tileset.tiles[0].contents[1].backgroundBlock = true;
  refused(writeScene(good, tileset), "a separate background block", train);
  tileset = makeTileset(good);
  tileset.tiles[0].contents[0].box.high[2] /= 2;
  refused(writeScene(good, tileset), "outside of the content's box", "copy the scene again");
  tileset = makeTileset(good);
  tileset.representation = "mesh";
  refused(writeScene(good, tileset), "is a scene of mesh", train);

  VolumeContent content = good;
  content.parts[0].contracted = false;
  content.parts[0].low = {-1, -1, -1};
  content.parts[0].high = {1, 1, 1};
  refused(writeScene(content), "is a bounded block", train);
  content = good;
  content.parts[0].scale = {1, 1, 2};
  refused(writeScene(content), "has different scales", train);
  content = good;
  content.network = darkNetwork();
  refused(writeScene(content), "has a network", train);
  content.network = randomNetwork(1, {34, 20, 16, 3});
  refused(writeScene(content), "has a network", train);
  content = good;
  content.parts[0].macroblocks.assign(content.parts[0].macroblocks.size(), VolumePart::kEmpty);
  content.parts[0].voxelBytes.clear();
  refused(writeScene(content), "contains nothing visible", "train longer");
  refused(writeScene(good), "has 32 voxels and planes of 64 texels", "--set voxels=128 --set planes=512");

  fs::create_directories(root_ / "model");
  writeFileAtomically(root_ / "model/blocks.json", std::string_view("{}"));
  refused(root_ / "model", "is a model", "tessera bake");
  const fs::path scene = writeScene(good), file = contentPath(scene, readTileset(scene).tiles[0].contents[0].uri);
  fs::resize_file(file, fs::file_size(file) / 2);
  refused(scene, "", "bake it again");
  refused(root_ / "nowhere", "", "");
}

TEST_F(Merf, LeavesFoldersOfOthersAlone) {
  writeFileAtomically(root_ / "out/holiday.png", std::string_view("mine"));
  const fs::path scene = writeScene(largeBlock());
  EXPECT_THROW(exportMerf(scene, root_ / "out"), Error);
  EXPECT_EQ(readTextFile(root_ / "out/holiday.png"), "mine");
}

}  // namespace
}  // namespace tessera

// Partitions real photographs into blocks. The photographs are not part of the project: TESSERA_SHARED_DATA names the
// folder that contains them.
#include <gtest/gtest.h>
#include <unistd.h>

#include <nlohmann/json.hpp>

#include "base/testing/shared_data.h"
#include "import/importer.h"
#include "partition/block_map.h"

namespace tessera {
namespace {

class PartitionOfRealData : public testing::Test {
 protected:
  void SetUp() override {
    const auto* test = testing::UnitTest::GetInstance()->current_test_info();
    folder_ = fs::weakly_canonical(fs::temp_directory_path()) /
              ("tessera-partition-" + std::string(test->name()) + "-" + std::to_string(::getpid()));
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  void TearDown() override {
    std::error_code ignored;
    fs::remove_all(folder_, ignored);
  }
  fs::path folder_;
};

TEST_F(PartitionOfRealData, BrightonBeachIsAGeoreferencedFieldUnderAFlight) {
  SKIP_WITHOUT_SHARED_DATA("brighton_beach");
  const fs::path beach = sharedData("brighton_beach");
  const Capture capture = importCapture(beach, folder_ / "capture", {.downscale = 8});
  const Partition partition = partitionCapture(capture, {.blocks = {false, 2, 2}, .enough = {3, 4096}});

  // The flight was 40 m above take-off; the beach is not flat.
  double flight = 0;
  for (const Photo& photo : capture.photos) {
    flight +=
        partition.ground.inGround(photo.worldFromCamera.translation).z() / static_cast<double>(capture.photos.size());
  }
  EXPECT_NEAR(flight, 40, 12);
  EXPECT_TRUE(partition.region.looksAtGround);
  // The ground resolution of a nadir photo at that height: height over focal length.
  EXPECT_NEAR(partition.region.groundPixel, flight / capture.cameras[0].focalX(), 0.1 * partition.region.groundPixel);

  // The photos are above the region; most points are inside it and within its height range.
  size_t inside = 0, between = 0;
  for (const SparsePoint& point : capture.points) {
    const Vec3d at = partition.ground.inGround(point.xInWorld);
    inside += partition.region.rectangle.holds(at.head<2>());
    between += at.z() >= partition.heights.bottom && at.z() <= partition.heights.top;
  }
  EXPECT_GT(static_cast<double>(inside), 0.9 * static_cast<double>(capture.points.size()));
  EXPECT_GT(static_cast<double>(between), 0.98 * static_cast<double>(capture.points.size()));
  EXPECT_LT(partition.heights.top, flight);
  EXPECT_LE(partition.grid.top - partition.grid.bottom, partition.grid.edge);
  for (const CellCoverage& cell : partition.coverage) EXPECT_GE(cell.photos, 3);
  EXPECT_TRUE(partition.thin.empty());

  // The map is where the photos' GPS places them.
  ASSERT_TRUE(writeBlockMap(folder_, capture, partition));
  const nlohmann::json map = nlohmann::json::parse(readTextFile(folder_ / "blocks.geojson"));
  double west = 180, east = -180, south = 90, north = -90;
  for (const nlohmann::json& feature : map.at("features")) {
    for (const nlohmann::json& corner : feature.at("geometry").at("coordinates").at(0)) {
      west = std::min(west, corner[0].get<double>());
      east = std::max(east, corner[0].get<double>());
      south = std::min(south, corner[1].get<double>());
      north = std::max(north, corner[1].get<double>());
    }
  }
  for (const Photo& photo : capture.photos) {
    EXPECT_GT(photo.gps->longitude, west) << photo.name;
    EXPECT_LT(photo.gps->longitude, east) << photo.name;
    EXPECT_GT(photo.gps->latitude, south) << photo.name;
    EXPECT_LT(photo.gps->latitude, north) << photo.name;
  }
}

TEST_F(PartitionOfRealData, FoxIsOneSquareAmongCameras) {
  SKIP_WITHOUT_SHARED_DATA("fox");
  const fs::path fox = sharedData("fox");
  const Capture capture = importCapture(fox, folder_ / "capture", {.downscale = 8});
  const Partition partition = partitionCapture(capture, {.blocks = {false, 1, 1}});
  EXPECT_FALSE(partition.region.looksAtGround);
  EXPECT_EQ(partition.region.rectangle.width, partition.region.rectangle.depth);
  EXPECT_LE(partition.grid.top - partition.grid.bottom, partition.grid.edge * (1 + 1e-12));
  // Every camera looks at it.
  ASSERT_EQ(partition.coverage.size(), 1u);
  EXPECT_EQ(partition.coverage[0].photos, static_cast<int>(capture.photosIn(Split::train).size()));
  EXPECT_FALSE(writeBlockMap(folder_, capture, partition));
  EXPECT_TRUE(fs::exists(folder_ / "blocks.svg"));
}

}  // namespace
}  // namespace tessera

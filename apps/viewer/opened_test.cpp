#include "apps/viewer/opened.h"

#include <gtest/gtest.h>

#include "base/testing/temporary_folder.h"
#include "train/model_folder.h"

namespace tessera {
namespace {

TEST(OpenedPlace, IsTheBoxOfAModelsBlocksAroundTheirCentre) {
  TemporaryFolder folder;
  BlockGrid grid;
  grid.originInWorld = {100, 200, 30};
  grid.edge = 50;
  grid.columns = 3;
  grid.rows = 2;
  grid.bottom = -5;
  grid.top = 20;
  ModelPlacement placement;
  placement.grid = grid;
  placement.capture = folder / "capture";
  ModelFolder(folder.path()).writePlacement(placement, "volume");
  ViewOptions options;
  options.folder = folder.path();
  const Place place = loadPlace(options);
  EXPECT_TRUE(place.low.isApprox(Vec3d(25, 150, 25))) << place.low.transpose();
  EXPECT_TRUE(place.high.isApprox(Vec3d(175, 250, 50))) << place.high.transpose();
}

}  // namespace
}  // namespace tessera

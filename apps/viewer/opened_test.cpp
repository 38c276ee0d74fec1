#include "apps/viewer/opened.h"

#include <gtest/gtest.h>

#include "base/error.h"
#include "base/testing/temporary_folder.h"
#include "gpu/testing/test_context.h"
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
  const Place place = loadPlace(options, readWorldToView(options));
  EXPECT_TRUE(place.low.isApprox(Vec3d(25, 150, 25))) << place.low.transpose();
  EXPECT_TRUE(place.high.isApprox(Vec3d(175, 250, 50))) << place.high.transpose();
}

TEST(OpenedWorld, IsReadOnceForItsPlaceAndItsPictures) {
  const std::shared_ptr<GpuContext> context = openForTest();
  SKIP_WITHOUT_VULKAN(context);
  TemporaryFolder folder;
  fs::create_directory_symlink(fs::path(TESSERA_GOLDEN_SCENES) / "volume", folder / "volume");
  writeFileAtomically(folder / "world.json", std::string_view(R"({"kind": "tessera world", "version": 2,
    "scenes": [{"url": "volume"}], "bookmarks": [{"name": "a", "view": "eye=1,2,3&target=4,5,6"}]})"));
  ViewOptions options;
  options.folder = folder.path();
  const std::optional<WorldToView> world = readWorldToView(options);
  fs::remove(folder / "world.json");
  EXPECT_EQ(loadPlace(options, world).views.size(), 1u);
  EXPECT_NE(openPictures(options, world, context), nullptr);
}

TEST(OpenedWorld, NeedsNoMainSceneThatIsInvisible) {
  TemporaryFolder folder;
  fs::create_directory_symlink(fs::path(TESSERA_GOLDEN_SCENES) / "volume", folder / "volume");
  const auto write = [&](const std::string& isVisible) {
    writeFileAtomically(folder / "world.json",
                        R"({"kind": "tessera world", "version": 2, "scenes": [{"url": "lost", "visible": )" +
                            isVisible + R"(}, {"url": "volume", "position": [100, 0, 0]}]})");
  };
  ViewOptions options;
  options.folder = folder.path();
  write("false");
  const std::optional<WorldToView> world = readWorldToView(options);
  EXPECT_TRUE(loadPlace(options, world).low.isApprox(Vec3d(55, -70, -13.75))) << loadPlace(options, world).low;
  write("true");
  EXPECT_THROW(loadPlace(options, readWorldToView(options)), Error);
  SKIP_WITHOUT_VULKAN(openForTest());
  const std::unique_ptr<Device> device = makeDevice({"vulkan", 2});
  EXPECT_THROW(openRenderSource(*device, folder.path(), {}), Error);
  write("false");
  const std::unique_ptr<RenderSource> source = openRenderSource(*device, folder.path(), {});
  Capture capture;
  capture.sourceFromWorld *= 2;
  EXPECT_NO_THROW(source->requireMatchingWorld(capture));
  EXPECT_THROW(source->sourceFromWorld(), Error);
}

}  // namespace
}  // namespace tessera

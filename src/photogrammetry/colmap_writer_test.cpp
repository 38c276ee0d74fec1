#include "photogrammetry/colmap_writer.h"

#include <gtest/gtest.h>

#include <cstring>

#include "base/error.h"
#include "base/testing/temporary_folder.h"

namespace tessera {
namespace {

ColmapModel makeModel() {
  ColmapModel model;
  Camera pinhole;
  pinhole.width = 640;
  pinhole.height = 480;
  pinhole.parameters = {500, 501, 320, 240};
  Camera distorting = pinhole;
  distorting.lens = LensModel::openCv;
  distorting.parameters = {500, 501, 320, 240, 0.1, -0.02, 1e-3, -2e-3};
  model.cameras = {{7, distorting}, {2, pinhole}};
  model.images.resize(2);
  model.images[0] = {9, 7, {0.5, 0.5, -0.5, 0.5}, {1, 2, 3}, "b.jpg", {{10.5, 20.5, 70}, {11, 12, 71}}};
  model.images[1] = {4, 2, {1, 0, 0, 0}, {0, 0, 5}, "a photo.jpg", {{1, 2, 71}}};
  model.points.resize(2);
  model.points[0] = {70, {{0.25, -1.5, 1000}, {1, 2, 255}, 0.5f}};
  model.points[1] = {71, {{0, 1, 2}, {3, 4, 5}, 0.25f}};
  return model;
}

TEST(ColmapWriter, WritesWhatIsReadAgain) {
  TemporaryFolder folder;
  const ColmapModel model = makeModel();
  writeColmapModel(model, folder.path());
  const ColmapModel read = readColmapModel(folder.path());
  EXPECT_EQ(read.cameras, model.cameras);
  ASSERT_EQ(read.images.size(), model.images.size());
  for (size_t i = 0; i < read.images.size(); ++i) {
    const ColmapModel::Image &a = read.images[i], &b = model.images[i];
    EXPECT_EQ(std::tie(a.id, a.camera, a.quaternion, a.translation, a.name),
              std::tie(b.id, b.camera, b.quaternion, b.translation, b.name));
    ASSERT_EQ(a.keypoints.size(), b.keypoints.size());
    for (size_t k = 0; k < a.keypoints.size(); ++k) {
      EXPECT_EQ(std::tie(a.keypoints[k].x, a.keypoints[k].y, a.keypoints[k].point),
                std::tie(b.keypoints[k].x, b.keypoints[k].y, b.keypoints[k].point));
    }
  }
  ASSERT_EQ(read.points.size(), model.points.size());
  for (size_t i = 0; i < read.points.size(); ++i) {
    const SparsePoint &a = read.points[i].point, &b = model.points[i].point;
    EXPECT_EQ(read.points[i].id, model.points[i].id);
    EXPECT_EQ(a.xInWorld, b.xInWorld);
    EXPECT_EQ(std::tie(a.colour, a.error), std::tie(b.colour, b.error));
  }
}

// The tracks are what bundle adjustment finds the observations by; the reader skips them.
TEST(ColmapWriter, WritesTheTrackOfEachPoint) {
  TemporaryFolder folder;
  writeColmapModel(makeModel(), folder.path());
  const Bytes bytes = readFile(folder / "points3D.bin");
  constexpr size_t kHead = 8 + 24 + 3 + 8;
  const size_t second = 8 + kHead + 8 + 8;  // behind the count and the first point, which has a track of one
  ASSERT_EQ(bytes.size(), second + kHead + 8 + 2 * 8);
  const auto at = [&](size_t place) {
    uint32_t value = 0;
    std::memcpy(&value, bytes.data() + place, sizeof value);
    return value;
  };
  EXPECT_EQ(at(8 + kHead), 1u);
  EXPECT_EQ(at(8 + kHead + 8), 9u) << "the image";
  EXPECT_EQ(at(8 + kHead + 12), 0u) << "its keypoint";
  EXPECT_EQ(at(second + kHead), 2u);
  EXPECT_EQ(at(second + kHead + 8), 9u);
  EXPECT_EQ(at(second + kHead + 12), 1u);
  EXPECT_EQ(at(second + kHead + 16), 4u);
  EXPECT_EQ(at(second + kHead + 20), 0u);
}

TEST(ColmapWriter, NamesAFileThatCannotBeWritten) {
  TemporaryFolder folder;
  try {
    writeFileAtomically(folder / "file", std::string("not a folder"));
    writeColmapModel(makeModel(), folder / "file");
    FAIL();
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("cameras.bin"), std::string::npos) << error.what();
  }
}

}  // namespace
}  // namespace tessera

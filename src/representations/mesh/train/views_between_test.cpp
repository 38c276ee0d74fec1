#include "representations/mesh/train/views_between.h"

#include <gtest/gtest.h>

#include "base/error.h"
#include "base/image_io.h"
#include "representations/mesh/testing/small_mesh.h"
#include "representations/mesh/train/train_mesh.h"
#include "representations/mesh/train/trained_mesh.h"
#include "train/testing/cube_scene.h"

namespace tessera {
namespace {

TEST(CountMissingViews, CompletesTheNumberOfPhotosOfEachPlace) {
  EXPECT_EQ(countMissingViews(15, 3, 8), 25u);
  EXPECT_EQ(countMissingViews(15, 8, 8), 0u);
  EXPECT_EQ(countMissingViews(15, 20, 8), 0u);
  EXPECT_EQ(countMissingViews(15, 1, 8), 45u) << "at most three for each photo";
  EXPECT_EQ(countMissingViews(15, 0, 8), 0u) << "they show no surface";
  EXPECT_EQ(countMissingViews(15, 3, 0), 0u);
}

class ViewsBetween : public testing::Test {
 protected:
  // Few photos of the cube.
  ViewsBetween() : device(makeDevice({"cpu", 2})) {}
  TrainingResult train(const std::string& name, const std::vector<std::string>& only, bool resume,
                       const std::string& backgroundBlock = "own") {
    TrainMeshOptions options;
    options.config = smallMeshConfig();
    options.config.backgroundBlock = backgroundBlock;
    options.config.enoughPhotos = 40;
    options.config.coarseSteps = 120;
    options.blocks = {false, 1, 1};
    options.loop.steps = 10;
    options.loop.progress = false;
    options.loop.resume = resume;
    options.only = only;
    return trainMesh(*device, scene.capture(), scene / name, options);
  }
  Bytes checkpoint(const std::string& name) const {
    const fs::path part = scene / name / "parts" / "block_0_0";
    return readFile(part / ModelFolder(part).manifest()->files.at(0));
  }

  const CubeScene scene{{.isEnclosed = true, .photos = 16}};
  const std::unique_ptr<Device> device;
};

TEST_F(ViewsBetween, AreNearThePhotosAndLookWhereTheyLook) {
  const Capture& capture = scene.capture();
  const Capture placed = placeViewsBetween(capture, 40, 7);
  ASSERT_EQ(placed.photos.size(), capture.photos.size() + 40);
  const std::vector<int> photos = capture.photosIn(Split::train);
  for (size_t view = capture.photos.size(); view < placed.photos.size(); ++view) {
    const Photo& added = placed.photos[view];
    EXPECT_EQ(added.split, Split::train);
    EXPECT_EQ(placed.cameras[static_cast<size_t>(added.camera)].width, CubeScene::kWidth / 2);
    EXPECT_NEAR(
        (added.worldFromCamera.rotation.transpose() * added.worldFromCamera.rotation - Mat3d::Identity()).norm(), 0,
        1e-9);
    const Photo& photo = capture.photos[static_cast<size_t>(photos[(view - capture.photos.size()) % photos.size()])];
    EXPECT_GT(added.worldFromCamera.rotation.col(2).dot(photo.worldFromCamera.rotation.col(2)), 0.69);
    EXPECT_GT((added.worldFromCamera.translation - photo.worldFromCamera.translation).norm(), 0);
  }
  const Capture again = placeViewsBetween(capture, 40, 7), other = placeViewsBetween(capture, 40, 8);
  const auto place = [](const Capture& of) { return of.photos.back().worldFromCamera.translation; };
  EXPECT_EQ(place(again), place(placed));
  EXPECT_NE(place(other), place(placed));
}

TEST_F(ViewsBetween, ShowWhatAPhotoWouldShowThere) {
  ASSERT_TRUE(train("mesh", {"coarse"}, false).finished);
  const Capture added = addViewsBetween(scene.capture(), scene / "mesh", smallMeshConfig().seed);
  ASSERT_GT(added.photos.size(), scene.capture().photos.size());
  double squares = 0;
  size_t numbers = 0;
  for (size_t view = scene.capture().photos.size(); view < added.photos.size(); ++view) {
    const Photo& photo = added.photos[view];
    const ImageU8 image = readImage(photo.image).image;
    const ImageF truth = scene.truth(added.cameras[static_cast<size_t>(photo.camera)], photo.worldFromCamera).colour;
    ASSERT_EQ(image.pixelCount(), truth.pixelCount());
    for (size_t i = 0; i < truth.pixels.size(); ++i) {
      const double difference = image.pixels[i] / 255.0 - truth.pixels[i];
      squares += difference * difference;
      ++numbers;
    }
  }
  EXPECT_LT(squares / static_cast<double>(numbers), 0.04);
}

TEST_F(ViewsBetween, AreNotMadeWithoutABackgroundBlock) {
  ASSERT_TRUE(train("mesh", {"coarse"}, false, "none").finished);
  EXPECT_FALSE(viewsFolder(scene / "mesh").isComplete());
}

TEST_F(ViewsBetween, AreTheSameForEveryProcess) {
  ASSERT_TRUE(train("together", {}, false).finished);
  ASSERT_TRUE(train("apart", {"coarse"}, false).finished);
  const fs::path view = scene / "apart" / "views" / "0000.png";
  const Bytes before = readFile(view);
  EXPECT_EQ(readFile(scene / "together" / "views" / "0000.png"), before);
  fs::remove(scene / "apart" / "views" / "views.json");  // as if it had been killed before it was written
  fs::remove(view);
  ASSERT_TRUE(train("apart", {"block_0_0"}, true).finished);
  EXPECT_EQ(readFile(view), before);
  EXPECT_EQ(checkpoint("apart"), checkpoint("together"));
}

TEST_F(ViewsBetween, AreRefusedIfTheirListIsMalformedOrOneIsMissing) {
  fs::create_directories(scene / "mesh" / "views");
  for (const char* list :
       {"[]", "{}", "{\"views\": -1}", "{\"views\": \"2\"}", "{\"views\": 1000000}", "{\"views\": 2}"}) {
    writeFileAtomically(scene / "mesh" / "views" / "views.json", std::string(list));
    try {
      addViewsBetween(scene.capture(), scene / "mesh", 1);
      FAIL() << list;
    } catch (const Error& error) {
      EXPECT_NE(std::string(error.what()).find("views.json"), std::string::npos) << error.what();
    }
  }
}

}  // namespace
}  // namespace tessera

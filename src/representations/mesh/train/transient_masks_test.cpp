#include "representations/mesh/train/transient_masks.h"

#include <gtest/gtest.h>

#include <map>

#include "base/error.h"
#include "base/image_io.h"
#include "representations/mesh/testing/small_mesh.h"
#include "representations/mesh/train/train_mesh.h"
#include "representations/mesh/train/trained_mesh.h"
#include "train/testing/cube_scene.h"

namespace tessera {
namespace {

// Photos with a stain in a corner, for which no masks are given.
class TransientMasks : public testing::Test {
 protected:
  TransientMasks() : device(makeDevice({"cpu", 2})), stained(scene.capture()) {
    for (Photo& photo : stained.photos) photo.mask.clear();
  }
  void trainParts(const std::string& name, const std::vector<std::string>& only, bool resume) {
    TrainMeshOptions options;
    options.config = smallMeshConfig();
    options.config.transient = "auto";
    options.config.coarseSteps = 120;
    options.blocks = {false, 1, 1};
    options.loop.steps = 10;
    options.loop.progress = false;
    options.loop.resume = resume;
    options.only = only;
    EXPECT_TRUE(trainMesh(*device, stained, scene / name, options).finished);
  }
  // Returns all files of the masks, and the last checkpoint of each part.
  std::map<std::string, Bytes> files(const std::string& name) const {
    std::map<std::string, Bytes> files;
    for (const auto& entry : fs::directory_iterator(scene / name / "transient"))
      files[entry.path().filename().string()] = readFile(entry.path());
    for (const char* part : {"parts/block_0_0", "parts/background"})
      if (const auto manifest = ModelFolder(scene / name / part).manifest())
        files[part] = readFile(scene / name / part / manifest->files.at(0));
    return files;
  }

  const CubeScene scene{{.isEnclosed = true, .stain = true}};
  std::unique_ptr<Device> device;
  Capture stained;
};

TEST_F(TransientMasks, LeaveTheSamePixelsOutInEveryProcess) {
  trainParts("whole", {}, false);
  const auto expected = files("whole");
  EXPECT_GT(expected.size(), 3u) << "the list, two parts, and some masks";
  fs::create_directories(scene / "apart");
  fs::copy(scene / "whole" / "coarse", scene / "apart" / "coarse", fs::copy_options::recursive);
  device = makeDevice({"cpu", 3});
  trainParts("apart", {"coarse"}, true);
  fs::remove(scene / "apart" / "transient" / "masks.json");  // as if it had been killed before it was written
  trainParts("apart", {"background"}, true);
  trainParts("apart", {"block_0_0"}, true);
  EXPECT_EQ(files("apart"), expected);
}

TEST_F(TransientMasks, ExcludeWhatThePhotosOwnMasksExclude) {
  constexpr int kWidth = CubeScene::kWidth, kHeight = CubeScene::kHeight;
  const std::vector<int> photos = stained.photosIn(Split::train);
  ImageU8 own(kWidth, kHeight, 1, 255);  // excludes the lower half
  std::fill(own.pixels.begin() + kWidth * kHeight / 2, own.pixels.end(), uint8_t{0});
  const fs::path ownFile = scene / "own.png";
  writePng(ownFile, own);
  const auto photoAt = [](Capture& capture, int number) -> Photo& {
    return capture.photos[static_cast<size_t>(number)];
  };
  photoAt(stained, photos[0]).mask = photoAt(stained, photos[1]).mask = ownFile;
  // The left half of the first and the third photo is transient, at half the resolution.
  std::vector<ImageU8> transients(photos.size(), ImageU8(kWidth / 2, kHeight / 2, 1, 255));
  for (const size_t i : {size_t{0}, size_t{2}})
    for (int y = 0; y < kHeight / 2; ++y) std::fill_n(transients[i].at(0, y), kWidth / 4, uint8_t{0});
  writeTransientMasks(stained, transients, scene / "mesh");
  Capture masked = applyTransientMasks(stained, scene / "mesh");
  const ImageU8 both = readImage(photoAt(masked, photos[0]).mask).image,
                transient = readImage(photoAt(masked, photos[2]).mask).image;
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      EXPECT_EQ(*both.at(x, y), x >= kWidth / 2 && y < kHeight / 2 ? 255 : 0) << x << ' ' << y;
      EXPECT_EQ(*transient.at(x, y), x >= kWidth / 2 ? 255 : 0) << x << ' ' << y;
    }
  }
  EXPECT_EQ(photoAt(masked, photos[1]).mask, ownFile) << "shows nothing transient";
  EXPECT_TRUE(photoAt(masked, photos[3]).mask.empty());
  transientFolder(scene / "mesh").remove();
  EXPECT_FALSE(transientFolder(scene / "mesh").isComplete());
  EXPECT_EQ(applyTransientMasks(stained, scene / "mesh").photos[0].mask, stained.photos[0].mask);
}

TEST_F(TransientMasks, AreRefusedIfOneIsMissing) {
  fs::create_directories(scene / "mesh" / "transient");
  const std::string name = stained.photos[0].name;
  for (const std::string& list :
       {std::string("[]"), std::string("{\"masks\": 1}"), "{\"masks\": {\"" + name + "\": 1}}",
        "{\"masks\": {\"" + name + "\": \"none.png\"}}", "{\"masks\": {\"" + name + "\": \"../../outside.png\"}}"}) {
    writeFileAtomically(scene / "mesh" / "transient" / "masks.json", list);
    try {
      applyTransientMasks(stained, scene / "mesh");
      FAIL() << list;
    } catch (const Error& error) {
      EXPECT_NE(std::string(error.what()).find("masks.json"), std::string::npos) << error.what();
    }
  }
}

}  // namespace
}  // namespace tessera

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
  const std::unique_ptr<Device> device;
  Capture stained;
};

TEST_F(TransientMasks, CoverWhatOnlyOnePhotoShows) {
  trainParts("mesh", {"coarse"}, false);
  const Capture masked = applyTransientMasks(stained, scene / "mesh");
  size_t stains = 0, covered = 0, others = 0, excluded = 0;
  for (const int number : stained.photosIn(Split::train)) {
    const Photo& photo = masked.photos[static_cast<size_t>(number)];
    const ImageU8 truth = readImage(scene.capture().photos[static_cast<size_t>(number)].mask).image;
    const ImageU8 mask = photo.mask.empty() ? ImageU8(truth.width, truth.height, 1, 255) : readImage(photo.mask).image;
    for (size_t i = 0; i < truth.pixels.size(); ++i) {
      const bool isExcluded = mask.pixels[i] == 0;
      (truth.pixels[i] == 0 ? stains : others) += 1;
      if (isExcluded) (truth.pixels[i] == 0 ? covered : excluded) += 1;
    }
  }
  EXPECT_GT(static_cast<double>(covered), 0.5 * static_cast<double>(stains));
  EXPECT_LT(static_cast<double>(excluded), 0.1 * static_cast<double>(others));
}

TEST_F(TransientMasks, AreTheSameWithAnyNumberOfThreads) {
  trainParts("mesh", {"coarse"}, false);
  const auto expected = files("mesh");
  EXPECT_GT(expected.size(), 10u);
  const std::unique_ptr<Device> other = makeDevice({"cpu", 3});
  removeTransientMasks(scene / "mesh");
  EXPECT_FALSE(haveTransientMasks(scene / "mesh"));
  makeTransientMasks(stained, *loadFieldModel(*other, scene / "mesh" / "coarse"), scene / "mesh");
  EXPECT_EQ(files("mesh"), expected);
}

TEST_F(TransientMasks, LeaveTheSamePixelsOutInEveryProcess) {
  trainParts("whole", {}, false);
  trainParts("apart", {"coarse"}, false);
  fs::remove(scene / "apart" / "transient" / "masks.json");  // as if it had been killed before it was written
  trainParts("apart", {"background"}, true);
  trainParts("apart", {"block_0_0"}, true);
  EXPECT_EQ(files("apart"), files("whole"));
}

TEST_F(TransientMasks, ExcludeWhatThePhotosOwnMasksExclude) {
  trainParts("mesh", {"coarse"}, false);
  // A mask that excludes the lower half of one photo.
  const int number = stained.photosIn(Split::train).at(0);
  Photo& photo = stained.photos[static_cast<size_t>(number)];
  ImageU8 own(CubeScene::kWidth, CubeScene::kHeight, 1, 255);
  std::fill(own.pixels.begin() + static_cast<ptrdiff_t>(own.pixels.size() / 2), own.pixels.end(), uint8_t{0});
  photo.mask = scene / "own.png";
  writePng(photo.mask, own);
  makeTransientMasks(stained, *loadFieldModel(*device, scene / "mesh" / "coarse"), scene / "mesh");
  const Capture masked = applyTransientMasks(stained, scene / "mesh");
  const ImageU8 both = readImage(masked.photos[static_cast<size_t>(number)].mask).image;
  for (size_t i = 0; i < own.pixels.size(); ++i)
    if (own.pixels[i] == 0) EXPECT_EQ(both.pixels[i], 0) << i;
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

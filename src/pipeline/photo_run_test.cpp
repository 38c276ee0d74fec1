#include "pipeline/photo_run.h"

#include <gtest/gtest.h>

#include <atomic>
#include <cstdlib>

#include "base/error.h"
#include "base/image_io.h"
#include "base/testing/shared_data.h"
#include "base/testing/temporary_folder.h"
#include "photogrammetry/testing/survey_photos.h"
#include "pipeline/georeference_json.h"
#include "pipeline/left_out_json.h"
#include "pipeline/posed_source.h"
#include "pipeline/training_planner.h"

namespace tessera {
namespace {

class PhotoRuns : public testing::Test {
 protected:
  PhotoRuns() : path_(std::getenv("PATH")) {
    // No program but the shell: what starts another one fails.
    ::setenv("PATH", (folder_ / "bin").c_str(), 1);
    options_.photos = folder_ / "photos";
    options_.out = folder_ / "out";
    options_.method = "volume";
    options_.threads = 2;
    options_.range.until = "capture";
  }
  ~PhotoRuns() override { ::setenv("PATH", path_.c_str(), 1); }

  // Returns what a run prints, and the error that ends it.
  std::string run() {
    testing::internal::CaptureStdout();
    testing::internal::CaptureStderr();
    std::string failure;
    try {
      runFromPhotos(options_);
    } catch (const Error& error) {
      failure = error.what();
    }
    std::fflush(stdout);
    const std::string said = testing::internal::GetCapturedStdout();
    return said + testing::internal::GetCapturedStderr() + failure;
  }

  // Writes photos a0.png, a1.png, …, and their poses as transforms.json with `keys`.
  void writePosed(int count, const std::string& keys = "") {
    std::string frames;
    for (int i = 0; i < count; ++i) {
      const std::string name = "images/a" + std::to_string(i) + ".png";
      writePng(options_.photos / name, ImageU8(16, 12, 3, static_cast<uint8_t>(20 * i)));
      frames += std::string(i > 0 ? "," : "") + R"({"file_path":")" + name + R"(","transform_matrix":[[1,0,0,)" +
                std::to_string(i) + R"(],[0,1,0,0],[0,0,1,0],[0,0,0,1]]})";
    }
    writeFileAtomically(options_.photos / "transforms.json", R"({"fl_x":14,"fl_y":14,"cx":8,"cy":6,"w":16,"h":12,)" +
                                                                 keys + R"("frames":[)" + frames + "]}");
  }

  bool has(const std::string& file) const { return fs::exists(options_.out / file); }
  static bool contains(const std::string& text, const std::string& part) { return text.find(part) != text.npos; }

  TemporaryFolder folder_;
  std::string path_;
  PhotoRunOptions options_;
};

TEST_F(PhotoRuns, OfPosedPhotosBeginAtTheCapture) {
  writePosed(9);
  std::string said = run();
  EXPECT_TRUE(contains(said, "has poses (transforms.json): the stages that find them are left out")) << said;
  EXPECT_TRUE(contains(said, "9 photos, 2 held out")) << said;
  EXPECT_FALSE(contains(said, "inspect")) << said;
  EXPECT_FALSE(has("poses/database.db"));
  EXPECT_EQ(probeImageFile(options_.out / "capture/images/a3.png").width, 16) << "small enough";
  said = run();
  EXPECT_TRUE(contains(said, "capture    finished before")) << said;
  writePosed(8);
  said = run();
  EXPECT_TRUE(contains(said, "8 photos, 1 held out")) << said;
  options_.range.from = "features";
  EXPECT_TRUE(contains(run(), "name one of capture, train, bake, evaluate, report"));
}

TEST_F(PhotoRuns, WriteAgainWhatOnlyTheReportReads) {
  writePosed(9);
  // A program that trains nothing.
  options_.program = (folder_ / "bin/verbs").string();
  writeFileAtomically(options_.program,
                      "#!/bin/sh\ncase $1 in\ntrain) /bin/mkdir -p $5; echo '{}' > $5/manifest.json ;;\n"
                      "bake) /bin/mkdir -p $5; echo '{}' > $5/tileset.json ;;\n"
                      "eval) echo '{\"psnr\": 1, \"ssim\": 1, \"exposure\": \"neutral\", \"views\": []}' > $7; echo > "
                      "$9 ;;\nesac\necho done\n");
  fs::permissions(options_.program, fs::perms::owner_all);
  options_.threads = 0;
  options_.range.until = "";
  std::string said = run();
  ASSERT_TRUE(has("report.html")) << said;
  fs::remove(options_.out / "poses/left_out.json");
  writeFileAtomically(options_.out / "poses/georeference.json", "damaged");
  options_.range.from = "report";
  said = run();
  EXPECT_TRUE(contains(said, "train      finished before")) << said;
  EXPECT_TRUE(has("poses/left_out.json"));
  EXPECT_NE(readTextFile(options_.out / "poses/georeference.json"), "damaged");
}

TEST_F(PhotoRuns, PlanForTheBlocksThatTagsAndThenTheCaptureTell) {
  std::vector<Capture> planned;
  options_.costs.trainBytes = 100 << 20;
  options_.costsOnCapture = [&](const Capture& capture) {
    planned.push_back(capture);
    TrainingCosts costs = options_.costs;
    costs.trainBytes += static_cast<int64_t>(capture.photos.size()) << 20;
    return costs;
  };
  for (int i = 0; i < 12; ++i) {
    writeSurveyPhoto(options_.photos / ("a" + std::to_string(i) + ".jpg"),
                     {.gps = {46.5 + 1e-4 * (i / 4), 6.5 + 1e-4 * (i % 4), 400, 60}, .seconds = 3.0 * i});
  }
  options_.dryRun = true;
  options_.range.until = "";
  std::string said = run();
  EXPECT_TRUE(contains(said, "apt-get install colmap")) << "before hours are planned that fail: " << said;
  writeFileAtomically(folder_ / "bin/colmap", "#!/bin/sh\necho COLMAP 3.8\n");
  fs::permissions(folder_ / "bin/colmap", fs::perms::owner_all);
  said = run();
  ASSERT_EQ(planned.size(), 1u) << said;
  EXPECT_EQ(planned[0].photos.size(), 12u);
  EXPECT_EQ(planned[0].cameras[0].width, 9) << "8 pixels, and a tenth more to be safe";
  EXPECT_TRUE(contains(said, " 112 MiB")) << said;

  planned.clear();
  options_.photos = folder_ / "posed";
  options_.dryRun = false;
  options_.program = (folder_ / "absent").string();
  writePosed(9);
  const std::string png = readTextFile(options_.photos / "images/a4.png");
  writeFileAtomically(options_.photos / "images/a4.png", png.substr(0, png.size() - 20));
  said = run();
  EXPECT_TRUE(contains(said, "absent: cannot be run")) << said;
  ASSERT_EQ(planned.size(), 2u);
  EXPECT_EQ(planned[0].photos.size(), 9u) << "those of the source";
  EXPECT_EQ(planned[0].cameras[0].width, 16);
  EXPECT_EQ(planned[1].photos.size(), 8u) << "those of the capture";
}

TEST_F(PhotoRuns, NamePhotosThatTheCaptureLacks) {
  writePosed(9);
  const std::string png = readTextFile(options_.photos / "images/a4.png");
  writeFileAtomically(options_.photos / "images/a4.png", png.substr(0, png.size() - 20));
  const std::string said = run();
  EXPECT_TRUE(contains(said, "8 photos")) << said;
  const std::vector<LeftOutPhoto> leftOut = readLeftOut(options_.out / "poses/left_out.json");
  ASSERT_EQ(leftOut.size(), 1u);
  EXPECT_TRUE(contains(leftOut[0].name, "a4.png"));
}

TEST_F(PhotoRuns, AreNotEvaluatedOnHeldOutPhotosThatAreMissing) {
  std::string trained;
  for (int i = 0; i < 8; ++i) trained += std::string(i > 0 ? "," : "") + "\"images/a" + std::to_string(i) + ".png\"";
  writePosed(9, "\"test_filenames\":[\"images/a8.png\"],\"train_filenames\":[" + trained + "],");
  EXPECT_TRUE(PosedSource::open(options_)->holdsOut());
  fs::remove(options_.photos / "images/a8.png");
  EXPECT_FALSE(PosedSource::open(options_)->holdsOut());
}

// In the capture, photos may have other names than in their source.
TEST_F(PhotoRuns, NameNoPhotoThatTheCaptureHas) {
  writePosed(9);
  options_.downscale = 2;
  std::string poses = readTextFile(options_.photos / "transforms.json");
  for (int i = 0; i < 9; ++i) {
    const std::string name = "a" + std::to_string(i) + ".png";
    fs::rename(options_.photos / "images" / name, options_.photos / name);
    poses.replace(poses.find("images/" + name), 7 + name.size(), name);
  }
  writeFileAtomically(options_.photos / "transforms.json", poses);
  run();
  EXPECT_EQ(readLeftOut(options_.out / "poses/left_out.json").size(), 0u);
  EXPECT_TRUE(fs::exists(options_.out / "capture/images/a4.png"));
}

TEST_F(PhotoRuns, OfPosedPhotosAreRepeatedIfTheirPlaceOnTheEarthChanges) {
  const auto placed = [&](const char* longitude) {
    writePosed(9, std::string(R"("tessera":{"geo":{"latitude":50,"longitude":)") + longitude +
                      R"(,"altitude":100,"enu_from_world":[[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]}},)");
    for (int i = 0; i < 9; ++i)
      fs::last_write_time(options_.photos / ("images/a" + std::to_string(i) + ".png"), fs::file_time_type{});
  };
  placed("8");
  run();
  placed("8");
  EXPECT_TRUE(contains(run(), "capture    finished before"));
  placed("9");
  EXPECT_FALSE(contains(run(), "capture    finished before"));
}

TEST_F(PhotoRuns, CanBeInterruptedWhilePhotosAreImported) {
  writePosed(9);
  std::atomic<int> asked = 0;
  options_.interrupted = [&] { return ++asked > 4; };
  EXPECT_THROW(runFromPhotos(options_), RunInterrupted);
  EXPECT_FALSE(has("capture/transforms.json"));
  EXPECT_GT(asked, 4);
  options_.interrupted = [] { return false; };
  EXPECT_TRUE(contains(run(), "9 photos, 2 held out"));
}

TEST_F(PhotoRuns, OfACopyOfTheirPhotosAreNotRepeated) {
  writePosed(9);
  run();
  options_.photos = folder_ / "copy";
  fs::copy(folder_ / "photos", options_.photos, fs::copy_options::recursive);
  for (int i = 0; i < 9; ++i)
    fs::last_write_time(options_.photos / ("images/a" + std::to_string(i) + ".png"), fs::file_time_type::clock::now());
  EXPECT_TRUE(contains(run(), "capture    finished before"));
  const fs::path changed = options_.photos / "images/a4.png";
  const auto time = fs::last_write_time(changed);
  writePng(changed, ImageU8(16, 12, 3, 99));
  fs::last_write_time(changed, time);
  EXPECT_FALSE(contains(run(), "capture    finished before"));
}

TEST_F(PhotoRuns, AreNotRepeatedForAnotherPlaceOfTheSameList) {
  writePosed(9);
  writeFileAtomically(folder_ / "a.txt", "images/a3.png\n");
  options_.holdout = "list:" + (folder_ / "a.txt").string();
  EXPECT_TRUE(contains(run(), "9 photos, 1 held out"));
  fs::rename(folder_ / "a.txt", folder_ / "b.txt");
  options_.holdout = "list:" + (folder_ / "b.txt").string();
  EXPECT_TRUE(contains(run(), "capture    finished before"));
  writeFileAtomically(folder_ / "b.txt", "images/a3.png\nimages/a4.png\n");
  EXPECT_TRUE(contains(run(), "9 photos, 2 held out"));
}

// The only photo that the source holds out ends early, and the import drops it.
TEST_F(PhotoRuns, AreNotEvaluatedIfTheImportDropsWhatIsHeldOut) {
  std::string trained;
  for (int i = 0; i < 8; ++i) trained += std::string(i > 0 ? "," : "") + "\"images/a" + std::to_string(i) + ".png\"";
  writePosed(9, "\"test_filenames\":[\"images/a8.png\"],\"train_filenames\":[" + trained + "],");
  const std::string png = readTextFile(options_.photos / "images/a8.png");
  writeFileAtomically(options_.photos / "images/a8.png", png.substr(0, png.size() - 20));
  options_.program = "/bin/true";  // trains and bakes nothing
  options_.range.until = "evaluate";
  const std::string said = run();
  EXPECT_TRUE(contains(said, "8 photos, 0 held out")) << said;
  EXPECT_TRUE(contains(said, "no photo is held out")) << said;
}

TEST_F(PhotoRuns, RefuseFoldersOfOtherPrograms) {
  writePosed(9);
  for (const char* name : {"probe", "logs", "scene"}) {
    fs::create_directories(options_.out / name);
    const std::string said = run();
    EXPECT_TRUE(contains(said, std::string(name) + ": was not made by such a run")) << said;
    fs::remove_all(options_.out);
  }
}

TEST_F(PhotoRuns, OfPosedPhotosTakeTheFileOfPosesAlone) {
  writePosed(3);
  options_.photos /= "transforms.json";
  EXPECT_TRUE(contains(run(), "3 photos, 1 held out"));
}

TEST_F(PhotoRuns, OfPosedPhotosReduceThemToASizeThatCanBeTrained) {
  writePosed(3);
  for (int i = 0; i < 3; ++i)
    writePng(options_.photos / ("images/a" + std::to_string(i) + ".png"), ImageU8(1680, 1260, 3));
  run();
  EXPECT_EQ(probeImageFile(options_.out / "capture/images/a1.png").width, 840);
}

// By the speed of another machine, or of another version of the program, the size would be another one.
TEST_F(PhotoRuns, KeepTheSizeOfPhotosOnAnotherMachine) {
  writePosed(3);
  for (int i = 0; i < 3; ++i)
    writePng(options_.photos / ("images/a" + std::to_string(i) + ".png"), ImageU8(1200, 900, 3));
  const auto width = [&] { return probeImageFile(options_.out / "capture/images/a1.png").width; };
  options_.minutes = 2;
  run();
  EXPECT_EQ(width(), 600);
  options_.costs.raysPerSecond *= 100;
  EXPECT_TRUE(contains(run(), "capture    finished before"));
  options_.minutes = 3;
  EXPECT_FALSE(contains(run(), "capture    finished before"));
  EXPECT_EQ(width(), 1200);
}

TEST_F(PhotoRuns, PlanForThePhotosOfACaptureThatIsKept) {
  writePosed(9);
  options_.downscale = 2;
  run();
  TrainingSize size{.photos = 9, .photoPixels = 16 * 12, .minutes = 1};
  TrainingPlanner planner(options_, {[&] { return size; }, [] { return std::nullopt; }, [] { return 1; }, false});
  const double seconds = planner.needs().bake.seconds;
  size.photoPixels = 8 * 6;
  EXPECT_EQ(seconds, planTraining(size, options_.costs).bake.seconds);
}

TEST_F(PhotoRuns, OfPosedPhotosUseTheSplitOfTheSource) {
  writePosed(
      4, R"("train_filenames":["images/a0.png","images/a1.png"],"test_filenames":["images/a2.png","images/a3.png"],)");
  EXPECT_TRUE(contains(run(), "4 photos, 2 held out"));
  options_.holdout = "every:4";
  EXPECT_TRUE(contains(run(), "4 photos, 1 held out"));
}

TEST_F(PhotoRuns, PutMasksIntoTheCapture) {
  writePosed(3);
  options_.masks = folder_ / "masks";
  EXPECT_TRUE(contains(run(), "masks: is not a folder"));
  ImageU8 mask(16, 12, 1, 255);
  mask.at(3, 4)[0] = 0;
  writePng(options_.masks / "a1.png", mask);
  std::string said = run();
  EXPECT_TRUE(contains(said, "1 of 3 photos have masks")) << said;
  EXPECT_EQ(readImage(options_.out / "capture/masks/a1.png").image.pixels, mask.pixels);
  EXPECT_FALSE(has("capture/masks/a0.png"));
  EXPECT_TRUE(contains(run(), "capture    finished before"));
  mask.at(5, 6)[0] = 0;
  writePng(options_.masks / "a1.png", mask);
  said = run();
  EXPECT_FALSE(contains(said, "capture    finished before")) << "masks have changed";
  EXPECT_EQ(readImage(options_.out / "capture/masks/a1.png").image.pixels, mask.pixels);
}

TEST_F(PhotoRuns, RefuseMasksAmongPhotos) {
  writeJpeg(options_.photos / "masks/a.jpg", ImageU8(8, 8, 1));
  options_.masks = options_.photos / "masks";
  EXPECT_TRUE(contains(run(), "masks would be taken for photos"));
}

TEST_F(PhotoRuns, OfPosedPhotosDoNotReplaceThem) {
  options_.photos = options_.out / "capture";
  writePosed(3);
  writeFileAtomically(options_.out / "run.json", "{}");
  EXPECT_TRUE(contains(run(), "is the capture that would be written"));
  options_.photos /= "transforms.json";
  EXPECT_TRUE(contains(run(), "is the capture that would be written"));
}

TEST_F(PhotoRuns, OfPhotosAloneFindTheirPoses) {
  for (int i = 0; i < 3; ++i)
    writeJpeg(options_.photos / ("images/" + std::to_string(i) + ".jpg"),
              ImageU8(16, 12, 3, static_cast<uint8_t>(20 * i)));
  // Neither of these is a model.
  writeFileAtomically(options_.photos / "sparse/notes.txt", "of the flight");
  writeFileAtomically(options_.photos / "cameras.txt", "1 PINHOLE 16 12 14 14 8 6");
  writeFileAtomically(options_.photos / "track.json", "{}");
  const std::string said = run();
  EXPECT_FALSE(contains(said, "has poses")) << said;
  EXPECT_TRUE(contains(said, "apt-get install colmap")) << said;
  options_.range.until = "inspect";
  EXPECT_TRUE(contains(run(), "3 photos, 0 with GPS"));
}

TEST_F(PhotoRuns, OfRealPosedPhotosBeginAtTheCapture) {
  SKIP_WITHOUT_SHARED_DATA("brighton_beach");
  options_.photos = sharedData("brighton_beach");
  options_.downscale = 16;
  const std::string said = run();
  EXPECT_TRUE(contains(said, "has poses (COLMAP model)")) << said;
  EXPECT_TRUE(contains(said, "18 photos, 3 held out, georeferenced")) << said;
  EXPECT_EQ(readGeoreference(options_.out / "poses/georeference.json").fixes, 18) << "for the report";
  EXPECT_FALSE(has("poses/database.db"));
}

TEST_F(PhotoRuns, OfAVideoNeedFfmpeg) {
  options_.photos = folder_ / "flight.mp4";
  writeFileAtomically(options_.photos, "a video");
  const std::string said = run();
  EXPECT_TRUE(contains(said, "ffprobe: cannot be run")) << said;
  EXPECT_TRUE(contains(said, "apt-get install ffmpeg")) << said;
  options_.range.from = "dinner";
  EXPECT_TRUE(contains(run(), "name one of frames, inspect, features")) << said;
}

}  // namespace
}  // namespace tessera

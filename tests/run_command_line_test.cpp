// `tessera run` as a user runs it: from photos without poses.
#include <gtest/gtest.h>

#include "base/image_io.h"
#include "base/testing/shared_data.h"
#include "base/testing/temporary_folder.h"
#include "tests/program.h"

namespace tessera {
namespace {

class RunCommandLine : public testing::Test {
 protected:
  Said run(const std::vector<std::string>& more) {
    std::vector<std::string> arguments = {"run", photos_.string(), (folder_ / "out").string()};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return Program(folder_.path(), arguments).wait();
  }

  TemporaryFolder folder_;
  fs::path photos_ = folder_ / "photos";
};

TEST_F(RunCommandLine, RefusesFoldersWithoutEnoughPhotos) {
  Said said = run({});
  EXPECT_EQ(said.exitCode, 1);
  EXPECT_TRUE(contains(said.err, "is neither a folder nor a file")) << said.err;
  writeJpeg(photos_ / "one.jpg", ImageU8(8, 8, 3));
  said = run({});
  EXPECT_EQ(said.exitCode, 1);
  EXPECT_TRUE(contains(said.err, "holds 1 photos that can be used")) << said.err;
  EXPECT_EQ(run({"--method", "field"}).exitCode, 2) << "it is not baked";
  said = run({"--device", "abacus"});
  EXPECT_EQ(said.exitCode, 1);
  EXPECT_TRUE(contains(said.err, "abacus")) << said.err;
  for (const char* out : {"", "/out"}) {
    said = Program(folder_.path(), {"run", photos_.string(), photos_.string() + out}).wait();
    EXPECT_EQ(said.exitCode, 1);
    EXPECT_TRUE(contains(said.err, "would be taken for photos")) << said.err;
  }
  EXPECT_FALSE(fs::exists(photos_ / "out"));
  EXPECT_EQ(run({"--holdout", "every:0"}).exitCode, 1);
}

TEST_F(RunCommandLine, RefusesFoldersThatItDidNotMake) {
  for (int i = 0; i < 3; ++i)
    writeJpeg(photos_ / (std::to_string(i) + ".jpg"), ImageU8(8, 8, 3, static_cast<uint8_t>(i)));
  writeFileAtomically(folder_ / "out/poses/database.db", "of another program");
  const Said said = run({});
  EXPECT_EQ(said.exitCode, 1);
  EXPECT_TRUE(contains(said.err, "would be replaced")) << said.err;
  EXPECT_EQ(readTextFile(folder_ / "out/poses/database.db"), "of another program");
}

TEST_F(RunCommandLine, NamesWhatToInstallAndWhichStagesThereAre) {
  for (int i = 0; i < 3; ++i)
    writeJpeg(photos_ / (std::to_string(i) + ".jpg"), ImageU8(8, 8, 3, static_cast<uint8_t>(i)));
  Said said = run({"--until", "dinner"});
  EXPECT_EQ(said.exitCode, 1);
  EXPECT_TRUE(
      contains(said.err,
               "name one of inspect, features, pairs, matches, mapping, remapping, adjusting, georeferencing, capture, "
               "train, bake, evaluate, report"))
      << said.err;
  const std::string path = std::getenv("PATH");
  ::setenv("PATH", "/nowhere", 1);
  said = run({});
  const Said inspected = run({"--until", "inspect"});
  ::setenv("PATH", path.c_str(), 1);
  EXPECT_EQ(said.exitCode, 1);
  EXPECT_TRUE(contains(said.err, "apt-get install colmap")) << said.err;
  EXPECT_EQ(inspected.exitCode, 0);
  EXPECT_TRUE(contains(inspected.out, "3 photos, 0 with GPS, 0 left out; 1 cameras, 1 flights")) << inspected.out;
}

TEST_F(RunCommandLine, KeepsTheFlagsOfTheRunBefore) {
  for (int i = 0; i < 3; ++i)
    writeJpeg(photos_ / (std::to_string(i) + ".jpg"), ImageU8(8, 8, 3, static_cast<uint8_t>(i)));
  EXPECT_EQ(run({"--until", "inspect", "--method", "volume", "--minutes", "7"}).exitCode, 0);
  Said said = run({"--until", "inspect"});
  EXPECT_TRUE(contains(said.err, "as before in " + (folder_ / "out").string() + ": --method volume --minutes 7"))
      << said.err;
  said = run({"--until", "inspect", "--method", "hash"});
  EXPECT_TRUE(contains(said.err, ": --minutes 7")) << said.err;
  writeFileAtomically(folder_ / "out/run.json", R"({"flags": {"--method": "field"}})");
  said = run({"--until", "inspect"});
  EXPECT_EQ(said.exitCode, 1);
  EXPECT_TRUE(contains(said.err, "run.json: flags: there is no method field; give --method")) << said.err;
}

TEST_F(RunCommandLine, TakesPhotosFromAVideo) {
  if (!isInPath("ffmpeg")) GTEST_SKIP() << "ffmpeg is not installed: videos are not tested";
  for (int i = 0; i < 12; ++i) {
    ImageU8 picture(64, 48, 3, static_cast<uint8_t>(20 * i));
    picture.at(3 * i, 2 * i)[0] ^= 255;
    writePng(folder_ / ("in/" + std::to_string(i) + ".png"), picture);
  }
  const fs::path video = folder_ / "a flight.mkv";
  const std::string command = "ffmpeg -nostdin -loglevel error -framerate 4 -i '" + (folder_ / "in/%d.png").string() +
                              "' -c:v ffv1 '" + video.string() + "'";
  ASSERT_EQ(std::system(command.c_str()), 0);
  const auto run = [&](const std::vector<std::string>& more) {
    std::vector<std::string> arguments = {"run", video.string(), (folder_ / "out").string(), "--until", "inspect"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return Program(folder_.path(), arguments).wait();
  };
  Said said = Program(folder_.path(), {"run", video.string(), (folder_ / "out").string(), "--dry-run"}).wait();
  EXPECT_EQ(said.exitCode, 0) << said.err;
  EXPECT_TRUE(contains(said.out, "frames ")) << said.out;
  EXPECT_FALSE(contains(said.out, "features")) << said.out << "is not known yet";
  EXPECT_TRUE(contains(said.err, "the stages after `frames` take is known when the frames are there")) << said.err;
  said = run({});
  ASSERT_EQ(said.exitCode, 0) << said.err;
  EXPECT_TRUE(contains(said.out, "12 frames of a video of 3.0 s")) << said.out;
  EXPECT_TRUE(contains(said.out, "12 photos, 0 with GPS, 0 left out; 1 cameras, 1 flights")) << said.out;
  EXPECT_TRUE(fs::exists(folder_ / "out/frames/frame_000011.jpg"));
  said = run({});
  EXPECT_TRUE(contains(said.out, "frames     finished before")) << said.out;
  said = run({"--frames", "4"});
  ASSERT_EQ(said.exitCode, 0) << said.err;
  EXPECT_TRUE(contains(said.out, "4 photos, 0 with GPS")) << said.out << "the others were of another number";
  const std::string path = std::getenv("PATH");
  ::setenv("PATH", "/nowhere", 1);
  said = run({"--frames", "5"});
  ::setenv("PATH", path.c_str(), 1);
  EXPECT_EQ(said.exitCode, 1);
  EXPECT_TRUE(contains(said.err, "apt-get install ffmpeg")) << said.err;
}

TEST_F(RunCommandLine, RefusesFramesOfAFolder) {
  fs::create_directories(photos_);
  const Said said = run({"--frames", "5"});
  EXPECT_EQ(said.exitCode, 1);
  EXPECT_TRUE(contains(said.err, "--frames: concerns videos")) << said.err;
}

TEST_F(RunCommandLine, ServesTheSceneWhenItHasEnded) {
  ASSERT_EQ(
      Program(folder_.path(), {"synth", "city", photos_.string(), "--photos", "8", "--size", "32x24"}).wait().exitCode,
      0);
  fs::create_directories(folder_ / "site");
  const std::vector<std::string> flags = {
      "run", photos_.string(), (folder_ / "out").string(), "--method", "volume", "--steps", "1", "--serve",
      "0",   "--viewer",       (folder_ / "site").string()};
  const Said refused = Program(folder_.path(), flags).wait();
  EXPECT_EQ(refused.exitCode, 1);
  EXPECT_TRUE(contains(refused.err, "site: holds no viewer; run tools/build-web.sh")) << refused.err;
  EXPECT_FALSE(fs::exists(folder_ / "out/capture")) << "nothing is done before this is known";

  writeFileAtomically(folder_ / "site/index.html", std::string_view("viewer"));
  Program program(folder_.path(), flags);
  waitUntil(program, [&] { return contains(program.said(), "open http://127.0.0.1:"); });
  program.kill(SIGINT);
  const Said said = program.wait();
  EXPECT_EQ(said.exitCode, 0) << said.err;
  EXPECT_TRUE(contains(said.out, "report.html")) << said.out;
  EXPECT_TRUE(fs::exists(folder_ / "out/scene/tileset.json"));
  EXPECT_EQ(run({"--serve", "0", "--until", "bake"}).exitCode, 2) << "the scene is served at the end only";
  for (const char* flag : {"--viewer", "--address"})
    EXPECT_EQ(run({flag, "."}).exitCode, 2) << flag << " is of no use without --serve";
}

TEST_F(RunCommandLine, FindsThePosesOfRealPhotos) {
  SKIP_WITHOUT_SHARED_DATA("brighton_beach");
  if (!isInPath("colmap")) {
    ASSERT_FALSE(sharedDataIsRequired()) << "colmap is not installed";
    GTEST_SKIP() << "colmap is not installed";
  }
  // Two names that would confuse COLMAP's lists.
  const char* names[] = {"a b/DJI_0018.JPG", "a b/DJI 0019.JPG", "DJI_0020.JPG", "DJI_0021.JPG"};
  for (int i = 0; i < 4; ++i) {
    fs::create_directories((photos_ / names[i]).parent_path());
    fs::copy_file(sharedData("brighton_beach") / "images" / ("DJI_00" + std::to_string(18 + i) + ".JPG"),
                  photos_ / names[i]);
  }
  ImageU8 mask(1600, 900, 1, 255);
  std::fill_n(mask.pixels.begin(), 1600 * 20, uint8_t{0});
  writePng(folder_ / "masks/a b/DJI 0019.JPG.png", mask);
  const std::vector<std::string> flags = {"--until",   "capture", "--downscale", "8",
                                          "--holdout", "none",    "--masks",     (folder_ / "masks").string()};
  Said said = run(flags);
  ASSERT_EQ(said.exitCode, 0) << said.err;
  EXPECT_TRUE(contains(said.out, "4 photos, 0 held out")) << said.out;
  EXPECT_TRUE(fs::exists(folder_ / "out/capture/images/a b/DJI_0018.png"));
  EXPECT_TRUE(fs::exists(folder_ / "out/capture/masks/a b/DJI 0019.png"));
  const auto timeOfModel = fs::last_write_time(folder_ / "out/poses/sparse/0/images.bin");
  said = run(flags);
  EXPECT_EQ(said.exitCode, 0) << said.err;
  EXPECT_TRUE(contains(said.out, "mapping    finished before")) << said.out;
  EXPECT_EQ(fs::last_write_time(folder_ / "out/poses/sparse/0/images.bin"), timeOfModel);

  // And so to a scene of which a photo is held out.
  const std::vector<std::string> onwards = {"--method", "volume", "--steps", "2", "--holdout", "every:4"};
  said = run(onwards);
  ASSERT_EQ(said.exitCode, 0) << said.err;
  EXPECT_TRUE(contains(said.out, "adjusting  finished before")) << said.out;
  EXPECT_TRUE(contains(said.err, "to watch the training: tail -f")) << said.err;
  EXPECT_TRUE(contains(said.out, "held-out PSNR ")) << said.out;
  EXPECT_TRUE(contains(readTextFile(folder_ / "out/report.html"), "<b>4</b><span class=\"quiet\">photos in the scene"));
  // Another program trains the model on.
  fs::copy_file(folder_ / "out/model/manifest.json", folder_ / "manifest.json");
  writeFileAtomically(folder_ / "out/model/manifest.json", readTextFile(folder_ / "manifest.json") + "\n");
  said = run({"--until", "bake"});
  ASSERT_EQ(said.exitCode, 0) << said.err;
  EXPECT_TRUE(contains(said.out, "train      finished before")) << said.out;
  EXPECT_FALSE(contains(said.out, "bake       finished before")) << said.out;
}

}  // namespace
}  // namespace tessera

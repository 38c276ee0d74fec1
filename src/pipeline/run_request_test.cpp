#include "pipeline/run_request.h"

#include <gtest/gtest.h>

#include "base/error.h"
#include "base/testing/temporary_folder.h"

namespace tessera {
namespace {

class RunRequests : public testing::Test {
 protected:
  RunRequests() {
    options_.out = folder_.path();
    options_.method = "hash";
  }

  void runWith(const PhotoRunOptions& options) {
    const Stage stage{.name = "one", .run = [](bool) { return ""; }};
    runStages(folder_.path(), describeRequest(options), {stage}, {.from = "one"});
  }
  PhotoRunOptions adopt(const std::set<std::string>& given) {
    PhotoRunOptions options = options_;
    adoptEarlierFlags(options, given);
    return options;
  }

  TemporaryFolder folder_;
  PhotoRunOptions options_;
};

TEST_F(RunRequests, KeepTheFlagsOfTheRunBefore) {
  EXPECT_EQ(adopt({}).minutes, 10) << "there is none";
  PhotoRunOptions earlier = options_;
  earlier.method = "volume";
  earlier.minutes = 0.3;
  earlier.downscale = 4;
  earlier.frames = 70;
  earlier.holdout = "list:a b.txt";
  earlier.device = "vulkan:1";
  earlier.masks = "masks";
  runWith(earlier);
  const PhotoRunOptions now = adopt({});
  EXPECT_EQ(now.method, "volume");
  EXPECT_EQ(now.minutes, 0.3);
  EXPECT_EQ(now.steps, 0);
  EXPECT_EQ(now.downscale, 4);
  EXPECT_EQ(now.frames, 70);
  EXPECT_EQ(now.holdout, "list:" + fs::absolute("a b.txt").string()) << "from another folder, too";
  EXPECT_EQ(now.device, "vulkan:1");
  EXPECT_EQ(now.masks, fs::absolute("masks"));
  runWith(now);
  EXPECT_EQ(adopt({}).minutes, 0.3) << "however often it is run";
}

TEST_F(RunRequests, AreKeptOfACallThatFindsEverythingDone) {
  const Stage stage{.name = "one", .run = [](bool) { return "done"; }};
  PhotoRunOptions options = options_;
  options.masks = "masks";
  runStages(folder_.path(), describeRequest(options), {stage}, {});
  const auto before = readStageRecords(folder_.path());
  options.masks.clear();
  runStages(folder_.path(), describeRequest(options), {stage}, {});
  EXPECT_TRUE(adopt({}).masks.empty());
  const auto after = readStageRecords(folder_.path());
  ASSERT_EQ(after.size(), 1u);
  EXPECT_EQ(after[0].summary, "done");
  EXPECT_EQ(after[0].seconds, before[0].seconds);
}

TEST_F(RunRequests, DescribeAListWithoutAName) {
  options_.holdout = "list:";
  EXPECT_EQ(describeRequest(options_).flags.at("--holdout"), "list:") << "which is refused in its own words";
}

TEST_F(RunRequests, PreferTheFlagsThatAreGiven) {
  PhotoRunOptions earlier = options_;
  earlier.steps = 300;
  earlier.masks = "masks";
  earlier.downscale = 2;
  runWith(earlier);
  EXPECT_EQ(adopt({}).steps, 300);
  options_.minutes = 5;
  EXPECT_EQ(adopt({"--minutes"}).steps, 0) << "minutes take the place of steps";
  EXPECT_EQ(adopt({"--minutes"}).minutes, 5);
  EXPECT_EQ(adopt({"--downscale"}).downscale, 0) << "chosen by the run";
  EXPECT_TRUE(adopt({"--masks"}).masks.empty());
  earlier.steps = 0;
  runWith(earlier);
  options_.steps = 7;
  EXPECT_EQ(adopt({"--steps"}).steps, 7);
  EXPECT_EQ(adopt({"--method"}).steps, 0);
}

TEST_F(RunRequests, RefuseAPlaceThatJsonCannotName) {
  options_.photos = folder_.path();
  options_.out = fs::temp_directory_path() /
                 "S\xfc"
                 "d";
  try {
    requireUsableRequest(options_);
    ADD_FAILURE() << "training would fail, after hours";
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("not UTF-8"), std::string::npos) << error.what();
  }
  options_.out = fs::temp_directory_path() / "S\xc3\xbc_d";
  EXPECT_NO_THROW(requireUsableRequest(options_));
}

TEST_F(RunRequests, RefuseWhatIsNoValue) {
  for (const char* flags :
       {R"("--minutes": "ten")", R"("--minutes": "-3")", R"("--steps": "0.5")", R"("--downscale": "99")",
        R"("--frames": "1e9")", R"("--minutes": "nan")", R"("--method": "")"}) {
    writeFileAtomically(folder_ / "run.json", std::string(R"({"flags": {)") + flags + "}}");
    EXPECT_THROW(adopt({}), Error) << flags;
  }
  writeFileAtomically(folder_ / "run.json", R"({"flags": {"--of-a-later-version": "1", "--method": "mesh"}})");
  EXPECT_EQ(adopt({}).method, "mesh");
}

}  // namespace
}  // namespace tessera

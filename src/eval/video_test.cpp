#include "eval/video.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>

#include "base/error.h"

namespace tessera {
namespace {

class Video : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::temp_directory_path() / ("tessera_video_" + std::to_string(::getpid()) + "_" +
                                           testing::UnitTest::GetInstance()->current_test_info()->name());
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }

  static bool hasProgram() {
    const char* search = std::getenv("PATH");
    std::string rest = search == nullptr ? "" : search;
    for (size_t at = 0; at <= rest.size();) {
      const size_t end = std::min(rest.find(':', at), rest.size());
      if (::access((rest.substr(at, end - at) + "/ffmpeg").c_str(), X_OK) == 0) return true;
      at = end + 1;
    }
    return false;
  }
  size_t filesLeft() const {
    return static_cast<size_t>(std::distance(fs::directory_iterator(folder_), fs::directory_iterator()));
  }

  fs::path folder_;
};

TEST_F(Video, IsWrittenAsAnMp4UnderAnUnusualName) {
  if (!hasProgram()) GTEST_SKIP() << "ffmpeg is not installed: encoding is not tested";
  const fs::path path = folder_ / "-odd name; $(x).mp4";  // must not be interpreted by a shell
  VideoOptions options;
  options.width = 33;  // odd, which the format does not support
  options.height = 21;
  VideoWriter writer(path, options);
  for (int i = 0; i < 5; ++i) writer.add(ImageU8(33, 21, 3, static_cast<uint8_t>(40 * i)));
  EXPECT_FALSE(fs::exists(path));
  writer.finish();
  EXPECT_EQ(filesLeft(), 1u);
  const std::string bytes = readTextFile(path);
  EXPECT_EQ(bytes.substr(4, 4), "ftyp");
  EXPECT_NE(bytes.find("avc1"), std::string::npos);
}

TEST_F(Video, RemovesWhatAKilledProcessLeftAndRefusesAFolder) {
  if (!hasProgram()) GTEST_SKIP() << "ffmpeg is not installed: encoding is not tested";
  const std::string ofNoProcess = "flight.mp4.partial-2147483646";
  writeFileAtomically(folder_ / ofNoProcess, std::string_view("half"));
  VideoOptions options;
  options.width = options.height = 16;
  {
    VideoWriter writer(folder_ / "flight.mp4", options);
    EXPECT_FALSE(fs::exists(folder_ / ofNoProcess));
  }
  fs::create_directories(folder_ / "folder.mp4");
  EXPECT_THROW(VideoWriter(folder_ / "folder.mp4", options), Error);
  EXPECT_EQ(filesLeft(), 1u);
}

TEST_F(Video, SaysHowToInstallAMissingProgram) {
  VideoOptions options;
  options.width = options.height = 2;
  options.program = "no-such-encoder-anywhere";
  try {
    VideoWriter writer(folder_ / "a.mp4", options);
    FAIL() << "no error";
  } catch (const Error& error) {
    EXPECT_EQ(error.subject(), "no-such-encoder-anywhere");
    EXPECT_NE(error.remedy().find("apt-get install ffmpeg"), std::string::npos);
  }
}

TEST_F(Video, ReportsAProgramThatDiesInsteadOfDyingWithIt) {
  VideoOptions options;
  options.width = options.height = 256;
  options.program = "false";  // ends at once, without reading a frame
  VideoWriter writer(folder_ / "a.mp4", options);
  EXPECT_THROW(
      {
        for (int i = 0; i < 20; ++i) writer.add(ImageU8(256, 256, 3));
        writer.finish();
      },
      Error);
  EXPECT_EQ(filesLeft(), 0u);
}

TEST_F(Video, ReportsTheMessagesOfTheProgram) {
  if (!hasProgram()) GTEST_SKIP() << "ffmpeg is not installed: its messages are not tested";
  VideoOptions options;
  options.width = options.height = 16;
  writeFileAtomically(folder_ / "file", std::string_view("not a folder"));
  VideoWriter writer(folder_ / "file" / "a.mp4", options);
  try {
    for (int i = 0; i < 2000; ++i) writer.add(ImageU8(16, 16, 3));
    writer.finish();
    FAIL() << "no error";
  } catch (const Error& error) {
    EXPECT_NE(error.reason().find("Not a directory"), std::string::npos) << error.what();
  }
}

TEST_F(Video, LeavesNothingBehindWhenAbandoned) {
  if (!hasProgram()) GTEST_SKIP() << "ffmpeg is not installed: abandoning it is not tested";
  {
    VideoOptions options;
    options.width = options.height = 64;
    VideoWriter writer(folder_ / "a.mp4", options);
    for (int i = 0; i < 30; ++i) writer.add(ImageU8(64, 64, 3));
  }
  EXPECT_EQ(filesLeft(), 0u);
}

}  // namespace
}  // namespace tessera

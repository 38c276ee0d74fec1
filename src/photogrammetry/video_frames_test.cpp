#include "photogrammetry/video_frames.h"

#include <gtest/gtest.h>

#include "base/child_process.h"
#include "base/error.h"
#include "base/image_io.h"
#include "base/testing/temporary_folder.h"

namespace tessera {
namespace {

bool hasFfmpeg() {
  ChildProcess process;
  return process.start({"ffmpeg", "-version"}).empty() && process.wait().empty();
}

#define SKIP_WITHOUT_FFMPEG() \
  if (!hasFfmpeg()) GTEST_SKIP() << "ffmpeg is not installed: videos are not tested"

class VideoFramesOf : public testing::Test {
 protected:
  // Encodes frames, each of the brightness 8 times its number with a sharp pattern in every fourth, and what `more`
  // adds.
  fs::path writeVideo(const std::string& name, int count, const std::vector<std::string>& more = {}) {
    for (int i = 0; i < count; ++i) {
      ImageU8 picture(96, 64, 3, static_cast<uint8_t>(8 * i));
      for (int y = 0; y < 64 && i % 4 == 2; ++y)
        for (int x = y % 4; x < 96; x += 4) picture.at(x, y)[1] = 255;
      writePng(folder_ / ("in/" + std::to_string(i) + ".png"), picture);
    }
    std::vector<std::string> arguments{
        "ffmpeg", "-nostdin", "-loglevel", "error", "-y", "-framerate", "16", "-i", (folder_ / "in/%d.png").string()};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const fs::path file = folder_ / name;
    arguments.insert(arguments.end(), {"-pix_fmt", "yuv444p", "-qp", "0", "-threads", "1", file.string()});
    ChildProcess process;
    EXPECT_EQ(process.start(arguments), "");
    EXPECT_EQ(process.wait(), "") << process.lastWords();
    return file;
  }

  VideoFrames frames(const fs::path& video, int count = 0) {
    return {video, folder_ / "frames", {.count = count, .threads = 1}};
  }

  void take(VideoFrames& frames) {
    frames.inspect([](int64_t) {});
    frames.choose([](int64_t) {});
    frames.extract([](int64_t) {});
  }

  std::string failure(const fs::path& video, VideoFrameOptions options = {}) {
    try {
      VideoFrames frames(video, folder_ / "frames", std::move(options));
      take(frames);
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  }

  // The names of the files in the folder of frames, sorted.
  std::string files() {
    std::vector<std::string> names;
    for (const auto& entry : fs::directory_iterator(folder_ / "frames")) names.push_back(entry.path().filename());
    std::sort(names.begin(), names.end());
    std::string text;
    for (const std::string& name : names) text += name + " ";
    return text;
  }

  TemporaryFolder folder_;
};

TEST_F(VideoFramesOf, AVideoAreTheSharpestByNumber) {
  SKIP_WITHOUT_FFMPEG();
  VideoFrames frames = this->frames(writeVideo("video.mkv", 16));
  EXPECT_FALSE(frames.isComplete());
  take(frames);
  EXPECT_TRUE(frames.isComplete());
  EXPECT_EQ(files(), "frame_000002.jpg frame_000006.jpg frame_000010.jpg frame_000014.jpg frames.json ");
  for (const int number : {2, 6, 10, 14}) {
    const ImageU8 picture = readImage(folder_ / ("frames/frame_0000" + std::string(number < 10 ? "0" : "") +
                                                 std::to_string(number) + ".jpg"))
                                .image;
    ASSERT_EQ(picture.width, 96);
    ASSERT_EQ(picture.height, 64);
    int red = 0;
    for (size_t i = 0; i < picture.pixels.size(); i += 3) red += picture.pixels[i];
    EXPECT_NEAR(static_cast<double>(red) / static_cast<double>(picture.pixelCount()), 8 * number, 3)
        << "it is the frame of that number";
  }
}

TEST_F(VideoFramesOf, AVideoAreKept) {
  SKIP_WITHOUT_FFMPEG();
  VideoFrames frames = this->frames(writeVideo("video.mkv", 16));
  take(frames);
  const auto time = fs::last_write_time(folder_ / "frames/frame_000006.jpg");
  const std::string lost = readTextFile(folder_ / "frames/frame_000010.jpg");
  fs::remove(folder_ / "frames/frame_000010.jpg");
  EXPECT_FALSE(frames.isComplete());
  take(frames);
  EXPECT_TRUE(frames.isComplete());
  EXPECT_EQ(fs::last_write_time(folder_ / "frames/frame_000006.jpg"), time);
  EXPECT_EQ(readTextFile(folder_ / "frames/frame_000010.jpg"), lost);
  writeFileAtomically(folder_ / "frames/mine.txt", "of the user");
  frames.discard();
  EXPECT_EQ(files(), "mine.txt ");
}

TEST_F(VideoFramesOf, AVideoHaveThePlaceThatTheirTimesSay) {
  SKIP_WITHOUT_FFMPEG();
  // Without the frames from 5 to 10: the second of four intervals has none, the first and the last have a sharp one.
  const fs::path video = writeVideo("video.mkv", 16, {"-vf", "select='lt(n,5)+gt(n,10)'", "-fps_mode", "vfr"});
  VideoFrames frames = this->frames(video, 4);
  take(frames);
  // Numbers count the frames that there are: 8 was 14.
  EXPECT_EQ(files(), "frame_000002.jpg frame_000005.jpg frame_000008.jpg frames.json ");
}

// As phones film: the frames are less than half of a mean interval apart here and there.
TEST_F(VideoFramesOf, AVideoOfAVariableRateAreNoDamage) {
  SKIP_WITHOUT_FFMPEG();
  const fs::path video = writeVideo("video.mp4", 16,
                                    {"-vf", "settb=1/90000,setpts='N*5625+mod(N*1237,4000)'", "-fps_mode",
                                     "passthrough", "-enc_time_base", "1:90000", "-video_track_timescale", "90000"});
  VideoFrames frames = this->frames(video);
  testing::internal::CaptureStderr();
  take(frames);
  const std::string said = testing::internal::GetCapturedStderr();
  EXPECT_EQ(said.find("reports"), said.npos) << said;
  EXPECT_EQ(frames.chosen(), 4u);
}

TEST_F(VideoFramesOf, ACopyOfAVideoAreKept) {
  SKIP_WITHOUT_FFMPEG();
  const fs::path video = writeVideo("video.mkv", 16), copy = folder_ / "copy.mkv";
  VideoFrames frames = this->frames(video);
  take(frames);
  fs::copy_file(video, copy);
  fs::last_write_time(copy, fs::file_time_type());
  EXPECT_TRUE(this->frames(copy).isComplete());
  EXPECT_FALSE(this->frames(writeVideo("other.mkv", 15)).isComplete());
}

TEST_F(VideoFramesOf, AVideoInHdrAreWarnedOf) {
  SKIP_WITHOUT_FFMPEG();
  for (const bool isHdr : {true, false}) {
    VideoFrames frames =
        this->frames(writeVideo(isHdr ? "hdr.mp4" : "sdr.mp4", 4, {"-color_trc", isHdr ? "arib-std-b67" : "bt709"}));
    testing::internal::CaptureStderr();
    frames.inspect([](int64_t) {});
    EXPECT_EQ(testing::internal::GetCapturedStderr(), "") << "plans need no warning";
    testing::internal::CaptureStderr();
    frames.choose([](int64_t) {});
    const std::string said = testing::internal::GetCapturedStderr();
    EXPECT_EQ(said.find("its colours are HDR") != said.npos, isHdr) << said;
  }
}

TEST_F(VideoFramesOf, AVideoAreTurnedAndHaveSquarePixels) {
  SKIP_WITHOUT_FFMPEG();
  const fs::path video = writeVideo("video.mp4", 4, {"-vf", "setsar=2"});
  const fs::path turned = folder_ / "turned.mp4";
  ChildProcess process;
  ASSERT_EQ(process.start({"ffmpeg", "-nostdin", "-loglevel", "error", "-i", video.string(), "-c", "copy",
                           "-metadata:s:v:0", "rotate=90", turned.string()}),
            "");
  ASSERT_EQ(process.wait(), "") << process.lastWords();
  VideoFrames frames = this->frames(turned);
  take(frames);
  const ImageInfo picture = probeImageFile(folder_ / "frames/frame_000002.jpg");
  EXPECT_EQ(picture.width, 32) << "64, halved by pixels that are twice as high as wide once they are turned";
  EXPECT_EQ(picture.height, 96);
}

TEST_F(VideoFramesOf, ALongVideoMayBeMany) {
  SKIP_WITHOUT_FFMPEG();
  ChildProcess process;
  const fs::path video = folder_ / "long.mkv";
  ASSERT_EQ(process.start({"ffmpeg", "-nostdin", "-loglevel", "error", "-f", "lavfi", "-i",
                           "testsrc=size=64x48:rate=100:duration=9", "-c:v", "ffv1", "-threads", "1", video.string()}),
            "");
  ASSERT_EQ(process.wait(), "") << process.lastWords();
  VideoFrames frames = this->frames(video, 450);
  take(frames);
  EXPECT_EQ(frames.chosen(), 450u);
  EXPECT_TRUE(frames.isComplete());
}

TEST_F(VideoFramesOf, SomethingElseAreRefused) {
  SKIP_WITHOUT_FFMPEG();
  writeFileAtomically(folder_ / "notes.mp4", "of the flight");
  EXPECT_NE(failure(folder_ / "notes.mp4").find("is no video that ffprobe can read"), std::string::npos);
  const fs::path video = writeVideo("video.mkv", 16);
  const std::string bytes = readTextFile(video);
  writeFileAtomically(folder_ / "cut.mkv", bytes.substr(0, 600));
  EXPECT_NE(failure(folder_ / "cut.mkv"), "");
  EXPECT_NE(failure(writeVideo("short.mkv", 2, {"-frames:v", "2"}))
                .find("has 2 frames that can be decoded; poses need three"),
            std::string::npos);
  ChildProcess process;
  ASSERT_EQ(process.start({"ffmpeg", "-nostdin", "-loglevel", "error", "-f", "lavfi", "-i", "sine=duration=1",
                           (folder_ / "sound.wav").string()}),
            "");
  ASSERT_EQ(process.wait(), "");
  EXPECT_NE(failure(folder_ / "sound.wav").find("has no video stream"), std::string::npos);
  EXPECT_FALSE(fs::exists(folder_ / "frames/frames.json"));
}

TEST_F(VideoFramesOf, AVideoNeedTheProgram) {
  writeFileAtomically(folder_ / "video.mp4", "video");
  const std::string message = failure(folder_ / "video.mp4", {.probe = "no-such-program"});
  EXPECT_NE(message.find("no-such-program: cannot be run"), std::string::npos) << message;
  EXPECT_NE(message.find("apt-get install ffmpeg"), std::string::npos) << message;
}

// Stand-ins for the two programs.
class VideoPrograms : public VideoFramesOf {
 protected:
  std::string write(const std::string& name, const std::string& script) {
    writeFileAtomically(folder_ / name, "#!/bin/sh\n" + script + "\n");
    fs::permissions(folder_ / name, fs::perms::owner_all);
    return folder_ / name;
  }
  // What it says of a video whose ffmpeg is this script, which finds the last argument as $last.
  std::string fail(const std::string& script) {
    const std::string probe = write("probe", "echo '{\"streams\": [{\"width\": 8, \"height\": 8}]}'");
    return failure(
        folder_ / "video.mp4",
        {.program = write("program", "for last; do :; done\nlast=${last#file:}\n" + script), .probe = probe});
  }
};

TEST_F(VideoPrograms, AreNotTrusted) {
  const std::string pictures = "for i in 1 2 3 4; do printf 'P5\\n2 2\\n255\\nabcd'; done\n";
  EXPECT_NE(fail(pictures + "echo broken frame >&2; exit 3").find("ended with status 3: broken frame"),
            std::string::npos);
  EXPECT_NE(fail(pictures + "kill -9 $$").find("was ended by signal 9"), std::string::npos);
  EXPECT_NE(fail("echo hello").find("writes no pictures"), std::string::npos);
  EXPECT_NE(fail("printf 'P5\\n60000 60000\\n255\\nabcd'").find("has 0 frames"), std::string::npos);
  EXPECT_NE(fail(pictures + "echo '#tb 0: 1/10' > $last").find("does not tell the times"), std::string::npos);
  EXPECT_NE(fail("if [ $last = pipe:1 ]; then printf 'P6\\n1 1\\n255\\nabc'; exit; fi\n" + pictures +
                 "echo '#tb 0: 1/10' > $last\nfor i in 0 1 2 3; do echo \"0, $i, $i, 1, 4, 0x0\" >> $last; done")
                .find("1 of 3 frames could be decoded"),
            std::string::npos);
}

TEST_F(VideoPrograms, EndWithAnInterruption) {
  const std::string probe = write("probe", "echo '{\"streams\": [{\"width\": 8, \"height\": 8}]}'");
  const std::string program = write("program", "echo $$ > " + (folder_ / "number").string() + "; exec sleep 600");
  VideoFrames frames(folder_ / "video.mp4", folder_ / "frames", {.program = program, .probe = probe});
  struct Interruption {};
  const auto watch = [this](int64_t) {
    if (fs::exists(folder_ / "number") && fs::file_size(folder_ / "number") > 0) throw Interruption();
  };
  EXPECT_THROW(frames.choose(watch), Interruption);
  EXPECT_FALSE(
      fs::exists("/proc/" + readTextFile(folder_ / "number").substr(0, readTextFile(folder_ / "number").find('\n'))));
}

}  // namespace
}  // namespace tessera

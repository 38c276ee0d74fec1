#include "photogrammetry/video_list.h"

#include <gtest/gtest.h>

namespace tessera {
namespace {

TEST(VideoList, ReadsWhatFfprobeTells) {
  const auto stream =
      parseVideoStream(R"({"programs": [], "streams": [{"width": 1920, "height": 1080, "avg_frame_rate": "30000/1001",)"
                       R"( "duration": "20.02", "nb_frames": "600"}], "format": {"duration": "21.0"}})");
  ASSERT_TRUE(stream);
  EXPECT_EQ(stream->width, 1920);
  EXPECT_EQ(stream->height, 1080);
  EXPECT_EQ(stream->frames, 600);
  EXPECT_DOUBLE_EQ(stream->seconds, 20.02);
  EXPECT_NEAR(stream->framesPerSecond, 29.97, 0.01);
  EXPECT_FALSE(stream->isHdr);
}

TEST(VideoList, TellsHdr) {
  const auto isHdr = [](const std::string& transfer) {
    const auto stream =
        parseVideoStream(R"({"streams": [{"width": 8, "height": 8, "color_transfer": ")" + transfer + R"("}]})");
    return stream && stream->isHdr;
  };
  EXPECT_TRUE(isHdr("arib-std-b67"));
  EXPECT_TRUE(isHdr("smpte2084"));
  EXPECT_FALSE(isHdr("bt709"));
}

TEST(VideoList, EstimatesWhatTheContainerDoesNotTell) {
  const auto stream = parseVideoStream(
      R"({"streams": [{"width": 64, "height": 48, "avg_frame_rate": "25/1"}], "format": {"duration": "4.0"}})");
  ASSERT_TRUE(stream);
  EXPECT_EQ(stream->frames, 100);
  const auto unknown = parseVideoStream(
      R"({"streams": [{"width": 64, "height": 48, "avg_frame_rate": "0/0", "duration": "N/A", "nb_frames": "-5"}]})");
  ASSERT_TRUE(unknown);
  EXPECT_EQ(unknown->frames, 0);
  EXPECT_EQ(unknown->seconds, 0);
  EXPECT_EQ(unknown->framesPerSecond, 0);
}

TEST(VideoList, RefusesWhatHasNoPictures) {
  for (const char* text :
       {"", "{", "[]", "{}", R"({"streams": []})", R"({"streams": {}})", R"({"streams": [3]})",
        R"({"streams": [{"width": 0, "height": 48}]})", R"({"streams": [{"width": 64}]})",
        R"({"streams": [{"width": 1e3, "height": 48}]})", R"({"streams": [{"width": 9000000000, "height": 48}]})",
        R"({"streams": [{"width": 70000, "height": 70000}]})"})
    EXPECT_FALSE(parseVideoStream(text)) << text;
}

TEST(VideoList, IgnoresAbsurdNumbers) {
  const auto stream = parseVideoStream(
      R"({"streams": [{"width": 64, "height": 48, "avg_frame_rate": "99999999999999999999/1", "duration": "1e300",)"
      R"( "nb_frames": "9000000000000000000"}]})");
  ASSERT_TRUE(stream);
  EXPECT_EQ(stream->frames, 0);
  EXPECT_EQ(stream->seconds, 0);
}

TEST(VideoList, ReadsTheTimesOfFrames) {
  const auto times = parseFrameTimes(
      "#software: Lavf59.27.100\n#tb 0: 1/1000\n#media_type 0: video\n"
      "0,          0,          0,       33,     4800, 0x26d968e4\n"
      "0,         33,         40,       33,     4800, 0x44616a3f\n"
      "0,       1367,       1367,       33,     4800, 0xf1652af1\n");
  EXPECT_EQ(times, (std::vector<double>{0, 0.04, 1.367}));
  EXPECT_EQ(parseFrameTimes(""), std::vector<double>{});
}

TEST(VideoList, RefusesTimesThatAreNone) {
  const std::string unit = "#tb 0: 1/1000\n";
  for (const std::string& text :
       {std::string("0, 0, 0, 33, 4800, 0x26d968e4\n"), "#tb 0: 0/0\n" + std::string("0, 0, 0, 33, 4800, 0x2\n"),
        unit + "0, 0\n", unit + "0, 0, x, 33\n", unit + "0, 0, , 33\n", unit + "0, 0, -9223372036854775808, 33\n",
        unit + "0, 0, 99999999999999999999, 33\n"})
    EXPECT_FALSE(parseFrameTimes(text)) << text;
}

TEST(VideoList, ReadsHeadersOfPictures) {
  const auto header = parsePnmHeader("P6\n640 360\n255\n");
  ASSERT_TRUE(header);
  EXPECT_EQ(header->width, 640);
  EXPECT_EQ(header->height, 360);
  EXPECT_EQ(header->channels, 3);
  EXPECT_EQ(parsePnmHeader("P5\n1 1\n255\n")->channels, 1);
  for (const char* text : {"", "P5\n255\n", "P5\n\n255\n", "P4\n1 1\n255\n", "P5\n1 1\n65535\n", "P5\n0 1\n255\n",
                           "P5\n1 -1\n255\n", "P5\n99999 1\n255\n", "P5\n1 1 1\n255\n", "P5\n1 1\n255"})
    EXPECT_FALSE(parsePnmHeader(text)) << text;
}

}  // namespace
}  // namespace tessera

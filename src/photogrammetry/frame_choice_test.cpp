#include "photogrammetry/frame_choice.h"

#include <gtest/gtest.h>

#include "base/random.h"

namespace tessera {
namespace {

using Frames = std::vector<size_t>;

ImageU8 noise(double scale, double offset) {
  ImageU8 picture(64, 48, 1);
  const RandomStream random(1, 1);
  for (size_t i = 0; i < picture.pixels.size(); ++i)
    picture.pixels[i] = static_cast<uint8_t>(offset + scale * random.uniformDouble(i));
  return picture;
}

ImageU8 blurred(const ImageU8& picture) {
  ImageU8 result = picture;
  for (int y = 0; y < picture.height; ++y)
    for (int x = 1; x + 1 < picture.width; ++x)
      result.at(x, y)[0] =
          static_cast<uint8_t>((picture.at(x - 1, y)[0] + picture.at(x, y)[0] + picture.at(x + 1, y)[0]) / 3);
  return result;
}

TEST(ImageSharpness, FallsWithBlurAndNotWithBrightness) {
  const ImageU8 sharp = noise(200, 20);
  EXPECT_GT(imageSharpness(sharp), 2 * imageSharpness(blurred(sharp)));
  EXPECT_GT(imageSharpness(noise(100, 10)), 0.7 * imageSharpness(sharp)) << "the same at half the exposure";
  EXPECT_GT(imageSharpness(noise(100, 10)), imageSharpness(blurred(sharp)));
  EXPECT_LT(imageSharpness(noise(2, 0)), 0.2 * imageSharpness(sharp)) << "noise of a black picture";
}

TEST(ImageSharpness, IsZeroOfWhatShowsNothing) {
  EXPECT_EQ(imageSharpness(ImageU8(64, 48, 1, 90)), 0);
  EXPECT_EQ(imageSharpness(ImageU8(2, 1, 1, 90)), 0);
  ImageU8 ramp(64, 48, 1);
  for (int y = 0; y < 48; ++y)
    for (int x = 0; x < 64; ++x) ramp.at(x, y)[0] = static_cast<uint8_t>(x + y);
  EXPECT_EQ(imageSharpness(ramp), 0);
}

std::vector<double> steadyTimes(size_t count, double perSecond) {
  std::vector<double> times;
  for (size_t i = 0; i < count; ++i) times.push_back(static_cast<double>(i) / perSecond);
  return times;
}

TEST(FrameChoice, TakesTheSharpestFrameOfEachInterval) {
  const std::vector<double> times = steadyTimes(40, 10);
  std::vector<double> sharpness(40, 1);
  sharpness[7] = sharpness[11] = sharpness[22] = sharpness[39] = 2;
  EXPECT_EQ(chooseFrames(times, sharpness, 4), (Frames{7, 12, 22, 39})) << "11 is too near to 7";
}

TEST(FrameChoice, KeepsFramesHalfAnIntervalApart) {
  const std::vector<double> times = steadyTimes(1000, 30);
  std::vector<double> sharpness;
  const RandomStream random(3, 1);
  for (size_t i = 0; i < times.size(); ++i) sharpness.push_back(random.uniformDouble(i));
  const Frames frames = chooseFrames(times, sharpness, 0);
  EXPECT_EQ(frames.size(), 133u) << "four a second";
  for (size_t i = 1; i < frames.size(); ++i)
    EXPECT_GE(times[frames[i]] - times[frames[i - 1]], kShortestInterval / 2 - 1e-9);
}

TEST(FrameChoice, TakesAtMostTwoHundredFramesUnlessAskedForMore) {
  const std::vector<double> times = steadyTimes(6000, 30), sharpness(6000, 1);
  EXPECT_EQ(chooseFrames(times, sharpness, 0).size(), 200u);
  EXPECT_EQ(chooseFrames(times, sharpness, 600).size(), 600u);
  EXPECT_EQ(chooseFrames(steadyTimes(15, 30), std::vector<double>(15, 1), 0).size(), 3u) << "half a second";
}

TEST(FrameChoice, TakesAllOfFewFrames) {
  const std::vector<double> times{0, 1, 1.01, 9};
  EXPECT_EQ(chooseFrames(times, std::vector<double>(4, 1), 10), (Frames{0, 1, 2, 3}));
  EXPECT_EQ(chooseFrames(std::vector<double>{5}, std::vector<double>{1}, 0), Frames{0});
  EXPECT_EQ(chooseFrames({}, {}, 0), Frames{});
}

TEST(FrameChoice, FollowsTimesAndNotNumbers) {
  // Twenty frames in the first second, a pause of eight, and then two in each second.
  std::vector<double> times = steadyTimes(20, 20);
  for (int i = 0; i < 4; ++i) times.push_back(9 + 0.5 * i);
  const Frames frames = chooseFrames(times, std::vector<double>(times.size(), 1), 11);
  EXPECT_EQ(frames, (Frames{0, 20, 22}));
}

TEST(FrameChoice, ManagesTimesThatAreDamaged) {
  const std::vector<double> none(100, 0.0), sharpness(100, 1);
  EXPECT_EQ(chooseFrames(none, sharpness, 10).size(), 10u) << "all at one time: by number";
  std::vector<double> times = steadyTimes(100, 10);
  times[50] = 0.1;
  const Frames frames = chooseFrames(times, sharpness, 10);
  EXPECT_TRUE(std::is_sorted(frames.begin(), frames.end()));
  EXPECT_EQ(frames.size(), 10u);
}

}  // namespace
}  // namespace tessera

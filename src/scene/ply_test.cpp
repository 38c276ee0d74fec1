#include "scene/ply.h"

#include <gtest/gtest.h>

#include <cstring>
#include <limits>

namespace tessera {
namespace {

std::span<const std::byte> asByteSpan(std::string_view text) {
  return std::as_bytes(std::span(text.data(), text.size()));
}

const std::string kAsciiHeader =
    "ply\r\nformat ascii 1.0\ncomment made by hand\nelement vertex 2\nproperty float x\nproperty float y\n"
    "property float z\nproperty float nx\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n"
    "element face 1\nproperty list uchar int vertex_indices\nend_header\n";

TEST(Ply, ReadsAsciiAndSkipsWhatItDoesNotKnow) {
  const auto points = decodePly(asByteSpan(kAsciiHeader + "1 2 3 0 10 20 30\n-1e2 0.5 nan 0 255 0 300\n3 0 1 1\n"));
  ASSERT_TRUE(points.has_value());
  ASSERT_EQ(points->size(), 2u);
  EXPECT_EQ((*points)[0].xInWorld, Vec3d(1, 2, 3));
  EXPECT_EQ((*points)[0].colour, (std::array<uint8_t, 3>{10, 20, 30}));
  EXPECT_EQ((*points)[1].xInWorld.x(), -100);
  EXPECT_TRUE(std::isnan((*points)[1].xInWorld.z()));
  EXPECT_EQ((*points)[1].colour, (std::array<uint8_t, 3>{255, 0, 255}));
}

TEST(Ply, ReadsBackExactlyWhatItWrote) {
  std::vector<SparsePoint> points(3);
  points[0] = {Vec3d(1.0 / 3, -1e-17, 123456789.123456789), {1, 2, 255}, 0.75f};
  points[2].xInWorld = Vec3d::Constant(-std::numeric_limits<double>::max());
  const auto again = decodePly(encodePly(points));
  ASSERT_TRUE(again.has_value());
  ASSERT_EQ(again->size(), 3u);
  for (size_t i = 0; i < 3; ++i) {
    EXPECT_EQ((*again)[i].xInWorld, points[i].xInWorld);
    EXPECT_EQ((*again)[i].colour, points[i].colour);
    EXPECT_EQ((*again)[i].error, points[i].error);
  }
}

TEST(Ply, ReadsFloatColoursAsFractions) {
  const auto points = decodePly(
      asByteSpan("ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\n"
                 "property float red\nproperty float green\nproperty float blue\nend_header\n0 0 0 1 0.5 -3"));
  ASSERT_TRUE(points.has_value());
  EXPECT_EQ((*points)[0].colour, (std::array<uint8_t, 3>{255, 128, 0}));
}

TEST(Ply, RefusesEveryTruncation) {
  const Bytes bytes = encodePly(std::vector<SparsePoint>(2));
  for (size_t length = 0; length < bytes.size(); ++length) {
    EXPECT_FALSE(decodePly(std::span(bytes).first(length)).has_value()) << length;
  }
}

TEST(Ply, RefusesCountsThatTheFileCannotHold) {
  std::string reason;
  EXPECT_FALSE(decodePly(asByteSpan("ply\nformat binary_little_endian 1.0\nelement vertex 18446744073709551615\n"
                                    "property float x\nproperty float y\nproperty float z\nend_header\n"),
                         &reason)
                   .has_value());
  EXPECT_NE(reason.find("claims"), std::string::npos) << reason;
}

TEST(Ply, RefusesWordsWhereNumbersBelong) {
  EXPECT_FALSE(decodePly(asByteSpan(kAsciiHeader + "1 2 x 0 10 20 30\n1 2 3 0 255 0 300\n")).has_value());
}

TEST(Ply, RefusesBigEndian) {
  EXPECT_FALSE(decodePly(asByteSpan("ply\nformat binary_big_endian 1.0\nelement vertex 0\nproperty float x\n"
                                    "property float y\nproperty float z\nend_header\n"))
                   .has_value());
}

}  // namespace
}  // namespace tessera

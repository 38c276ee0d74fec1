#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cstring>
#include <limits>

#include "base/error.h"
#include "import/colmap_model.h"
#include "import/testing/test_support.h"

namespace tessera {
namespace {

// Builds the binary files value by value.
class Writer {
 public:
  template <class T>
  Writer& add(T value) {
    const auto* begin = reinterpret_cast<const std::byte*>(&value);
    bytes.insert(bytes.end(), begin, begin + sizeof(T));
    return *this;
  }
  Writer& add(const std::string& text) {
    const auto* begin = reinterpret_cast<const std::byte*>(text.c_str());
    bytes.insert(bytes.end(), begin, begin + text.size() + 1);
    return *this;
  }
  Bytes bytes;
};

constexpr uint64_t kNoPoint = ~uint64_t{0};

// A model with one camera of every lens, two images and two points; its ids have gaps and are unordered.
struct BinaryModel {
  Writer cameras, images, points;

  BinaryModel() {
    cameras.add(uint64_t{std::size(kLensModels)});
    for (auto lens = std::rbegin(kLensModels); lens != std::rend(kLensModels); ++lens) {
      const int number = static_cast<int>(*lens);
      cameras.add(uint32_t(10 + 3 * number)).add(int32_t{number}).add(uint64_t{640}).add(uint64_t{480});
      for (int p = 0; p < lensParameterCount(*lens); ++p) cameras.add(p < 4 ? 100.0 + p : 0.001 * p);
    }
    images.add(uint64_t{2});
    images.add(uint32_t{9}).add(0.5).add(0.5).add(-0.5).add(0.5).add(1.0).add(2.0).add(3.0).add(uint32_t{13});
    images.add(std::string("b.jpg")).add(uint64_t{2});
    images.add(10.5).add(20.5).add(uint64_t{70}).add(1.0).add(2.0).add(kNoPoint);
    images.add(uint32_t{4}).add(1.0).add(0.0).add(0.0).add(0.0).add(0.0).add(0.0).add(5.0).add(uint32_t{10});
    images.add(std::string("a photo.jpg")).add(uint64_t{0});
    points.add(uint64_t{2});
    points.add(uint64_t{70}).add(0.25).add(-1.5).add(1e3).add(uint8_t{1}).add(uint8_t{2}).add(uint8_t{255}).add(0.5);
    points.add(uint64_t{1}).add(uint32_t{9}).add(uint32_t{0});
    points.add(uint64_t{71}).add(0.0).add(0.0).add(0.0).add(uint8_t{0}).add(uint8_t{0}).add(uint8_t{0}).add(-1.0);
    points.add(uint64_t{0});
  }
  std::optional<ColmapModel> decode() {
    std::string ignored;
    return decodeColmapBinary(cameras.bytes, images.bytes, points.bytes, ignored);
  }
};

TEST(Colmap, ReadsBinaryModels) {
  const auto model = BinaryModel().decode();
  ASSERT_TRUE(model.has_value());
  EXPECT_EQ(model->cameras.size(), 15u);
  EXPECT_EQ(model->cameras.at(22).lens, LensModel::openCv);
  EXPECT_EQ(model->cameras.at(43).parameters[15], 0.015);
  EXPECT_EQ(model->cameras.at(46).lens, LensModel::simpleDivision);
  EXPECT_EQ(model->cameras.at(49).lens, LensModel::division);
  EXPECT_EQ(model->cameras.at(58).lens, LensModel::eucm);
  ASSERT_EQ(model->images.size(), 2u);
  EXPECT_EQ(model->images[1].name, "a photo.jpg");
  ASSERT_EQ(model->images[0].keypoints.size(), 1u);  // the other one has no point
  EXPECT_EQ(model->images[0].keypoints[0].point, 70u);
  EXPECT_EQ(model->points[0].point.xInWorld, Vec3d(0.25, -1.5, 1000));
}

TEST(Colmap, ReadsTheSameFromTextAsFromBinary) {
  const auto binary = BinaryModel().decode();
  ASSERT_TRUE(binary.has_value());
  std::string cameras = "# Camera list\n", reason;
  for (const auto& [id, camera] : binary->cameras) {
    cameras += std::to_string(id) + " " + std::string(lensName(camera.lens)) + " 640 480";
    for (int p = 0; p < lensParameterCount(camera.lens); ++p)
      cameras += fmt::format(" {}", camera.parameters[size_t(p)]);
    cameras += "\n";
  }
  const std::string images =
      "# comment\n\n9 0.5 0.5 -0.5 0.5 1 2 3 13 b.jpg\r\n10.5 20.5 70 1 2 -1\r\n4 1 0 0 0 0 0 5 10 a photo.jpg\n\n";
  const std::string points = "# X\n70 0.25 -1.5 1e3 1 2 255 0.5 9 0\n71 0 0 0 0 0 0 -1\n";
  const auto text = decodeColmapText(cameras, images, points, reason);
  ASSERT_TRUE(text.has_value()) << reason;
  EXPECT_EQ(text->cameras, binary->cameras);
  ASSERT_EQ(text->images.size(), binary->images.size());
  for (size_t i = 0; i < 2; ++i) {
    EXPECT_EQ(text->images[i].id, binary->images[i].id);
    EXPECT_EQ(text->images[i].name, binary->images[i].name);
    EXPECT_EQ(text->images[i].quaternion, binary->images[i].quaternion);
    EXPECT_EQ(text->images[i].translation, binary->images[i].translation);
    EXPECT_EQ(text->images[i].camera, binary->images[i].camera);
    ASSERT_EQ(text->images[i].keypoints.size(), binary->images[i].keypoints.size());
  }
  EXPECT_EQ(text->images[0].keypoints[0].x, 10.5);
  EXPECT_EQ(text->points[0].point.xInWorld, binary->points[0].point.xInWorld);
  EXPECT_EQ(text->points[0].point.colour, binary->points[0].point.colour);
}

TEST(Colmap, RefusesEveryTruncationOfABinaryModel) {
  const BinaryModel whole;
  for (int file = 0; file < 3; ++file) {
    const auto length = std::array{&whole.cameras, &whole.images, &whole.points}[size_t(file)]->bytes.size();
    for (size_t cut = file == 2 ? 1 : 0; cut < length; ++cut) {  // no points at all are allowed
      BinaryModel model;
      std::array{&model.cameras, &model.images, &model.points}[size_t(file)]->bytes.resize(cut);
      EXPECT_FALSE(model.decode().has_value()) << file << " " << cut;
    }
  }
}

TEST(Colmap, RefusesCountsThatTheFileCannotHold) {
  for (int file = 0; file < 3; ++file) {
    for (const uint64_t count : {~uint64_t{0}, uint64_t{1} << 60, uint64_t{1000000}}) {
      BinaryModel model;
      std::memcpy(std::array{&model.cameras, &model.images, &model.points}[size_t(file)]->bytes.data(), &count, 8);
      EXPECT_FALSE(model.decode().has_value());
    }
  }
}

TEST(Colmap, SaysWhatIsWrongWithACamera) {
  std::string reason;
  EXPECT_FALSE(decodeColmapText("1 PINHOLE 640 480 1 2 3\n", "", "", reason).has_value());
  EXPECT_EQ(reason, "cameras.txt: line 1: PINHOLE takes 4 parameters, not 3");
  EXPECT_FALSE(decodeColmapText("1 EUCM 640 480 1 2 3 4 1.5 1\n", "", "", reason).has_value());
  EXPECT_EQ(reason, "cameras.txt: line 1: EUCM requires alpha from 0 to 1 and beta above 0");
  EXPECT_FALSE(decodeColmapText("1 PINHOLE 640 480 1 2 1e300 4\n", "", "", reason).has_value());
  EXPECT_FALSE(decodeColmapText("1 PINHOLE 640 99999999999 1 2 3 4\n", "", "", reason).has_value());
  EXPECT_FALSE(decodeColmapText("1 PINHOLE 640 480 nan 2 3 4\n", "", "", reason).has_value());
  EXPECT_FALSE(decodeColmapText("1 PINHOLE 640 480 -5 2 3 4\n", "", "", reason).has_value());
}

TEST(Colmap, ConvertsPosesAndComputesReprojectionErrors) {
  ColmapModel model;
  model.cameras[1] = {100, 100, LensModel::pinhole, {50, 50, 50, 50}};
  ColmapModel::Image image;
  image.camera = 1;
  image.name = "a.jpg";
  image.quaternion = {std::sqrt(0.5) * 3, 0, std::sqrt(0.5) * 3, 0};  // 90° about y, not normalised
  image.translation = {1, 2, 3};
  image.keypoints = {{60, 50, 7}, {0, 0, 8}};
  model.images = {image};
  // camera = R world + t with R = [[0,0,1],[0,1,0],[-1,0,0]]: the world point below is (0, 0, 2) in camera axes.
  model.points = {{7, {Vec3d(1, -2, -1), {}, 0}}};
  const TemporaryFolder folder;
  const SourceCapture source = captureFromColmap(model, folder.path());
  ASSERT_EQ(source.capture.photos.size(), 1u);
  const Pose& pose = source.capture.photos[0].worldFromCamera;
  EXPECT_NEAR((pose.translation - Vec3d(3, -2, -1)).norm(), 0, 1e-12);
  EXPECT_NEAR((pose.rotation.col(2) - Vec3d(-1, 0, 0)).norm(), 0, 1e-12);  // looks along -x
  ASSERT_EQ(source.capture.observations.size(), 1u);                       // point 8 does not exist
  EXPECT_NEAR(source.capture.observations[0].error, 10, 1e-5);
}

TEST(Colmap, DropsImagesWithInvalidPathsCamerasOrPoses) {
  const TemporaryFolder folder;
  ColmapModel model;
  model.cameras[1] = {100, 100, LensModel::pinhole, {50, 50, 50, 50}};
  ColmapModel::Image good;
  good.camera = 1;
  good.quaternion = {1, 0, 0, 0};
  good.name = "good.jpg";
  ColmapModel::Image bad = good;
  model.images.push_back(good);
  bad.name = "../../etc/passwd";
  model.images.push_back(bad);
  bad.name = "/etc/passwd";
  model.images.push_back(bad);
  bad = good;
  bad.camera = 2;
  model.images.push_back(bad);
  bad = good;
  bad.quaternion = {0, 0, 0, 0};
  model.images.push_back(bad);
  bad = good;
  bad.translation[1] = std::numeric_limits<double>::quiet_NaN();
  model.images.push_back(bad);
  bad.translation = {1.5e308, -1.5e308, 1.5e308};  // finite, but not once it is rotated
  bad.quaternion = {0.9, 0.1, 0.3, 0.2};
  model.images.push_back(bad);
  testing::internal::CaptureStderr();
  const SourceCapture source = captureFromColmap(model, folder.path());
  const std::string warnings = testing::internal::GetCapturedStderr();
  EXPECT_EQ(source.capture.photos.size(), 1u);
  EXPECT_NE(warnings.find("2 photos have paths that leave"), std::string::npos) << warnings;
  EXPECT_NE(warnings.find("3 photos have a pose that is not a number"), std::string::npos) << warnings;
  EXPECT_NE(warnings.find("1 photos name a camera"), std::string::npos) << warnings;
}

TEST(Colmap, DropsPointsThatAreImplausiblyFarAway) {
  ColmapModel model;
  model.points = {{1, {Vec3d(1, 2, 3), {}, 0}}, {2, {Vec3d(0, -1e308, 0), {}, 0}}};
  model.points.push_back({3, {Vec3d(0, std::nan(""), 0), {}, 0}});
  EXPECT_EQ(captureFromColmap(model, "/nowhere").capture.points.size(), 1u);
}

TEST(Colmap, DropsOnlyThePhotosOfALensThatCannotBeUsed) {
  const std::string images = "1 1 0 0 0 0 0 0 1 a.jpg\n\n2 1 0 0 0 0 0 0 2 b.jpg\n\n3 1 0 0 0 0 0 0 2 c.jpg\n\n";
  std::string reason;
  const auto text = decodeColmapText("2 EQUIRECTANGULAR 64 32 64 32\n1 PINHOLE 4 4 1 1 2 2\n", images, "", reason);
  ASSERT_TRUE(text.has_value()) << reason;
  Writer cameras;
  cameras.add(uint64_t{2});
  cameras.add(uint32_t{2}).add(int32_t{17}).add(uint64_t{64}).add(uint64_t{32}).add(64.0).add(32.0);
  cameras.add(uint32_t{1}).add(int32_t{1}).add(uint64_t{4}).add(uint64_t{4}).add(1.0).add(1.0).add(2.0).add(2.0);
  auto binary = decodeColmapBinary(cameras.bytes, Writer().add(uint64_t{0}).bytes, {}, reason);
  ASSERT_TRUE(binary.has_value()) << reason;
  binary->images = text->images;
  const TemporaryFolder folder;
  for (const auto& model : {*text, *binary}) {
    testing::internal::CaptureStderr();
    const SourceCapture source = captureFromColmap(model, folder.path());
    const std::string warnings = testing::internal::GetCapturedStderr();
    ASSERT_EQ(source.capture.photos.size(), 1u);
    EXPECT_EQ(source.capture.photos[0].name, "a.jpg");
    EXPECT_NE(warnings.find("2 photos were taken with the lens EQUIRECTANGULAR"), std::string::npos) << warnings;
    EXPECT_EQ(warnings.find("name a camera"), std::string::npos) << warnings;
  }
  // A lens with an unknown number is an error, because the start of the next camera is unknown too.
  cameras.bytes[12] = std::byte{99};
  EXPECT_FALSE(decodeColmapBinary(cameras.bytes, Writer().add(uint64_t{0}).bytes, {}, reason).has_value());
}

TEST(Colmap, IsFoundInTheFoldersThatColmapUses) {
  for (const std::string place : {"sparse/0", "sparse", "colmap/sparse/0", "."}) {
    const TemporaryFolder folder;
    writeFileAtomically(folder / place / "cameras.txt", std::string_view("1 PINHOLE 4 4 1 1 2 2\n"));
    writeFileAtomically(folder / place / "images.txt", std::string_view("1 1 0 0 0 0 0 0 1 a.png\n\n"));
    writeFileAtomically(folder / place / "points3D.txt", std::string_view(""));
    fs::create_directories(folder / "images");
    ASSERT_TRUE(findColmapModel(folder.path()).has_value()) << place;
    const SourceCapture source = readColmap(folder.path());
    ASSERT_EQ(source.capture.photos.size(), 1u);
    EXPECT_EQ(source.capture.photos[0].image, folder / "images/a.png") << place;
  }
}

void writeTextModel(const fs::path& folder, const std::string& images) {
  writeFileAtomically(folder / "cameras.txt", std::string_view("1 PINHOLE 4 4 1 1 2 2\n"));
  writeFileAtomically(folder / "images.txt", images);
  writeFileAtomically(folder / "points3D.txt", std::string_view(""));
}

TEST(Colmap, IsFoundByAnyWayToItsFolder) {
  const TemporaryFolder folder;
  writeTextModel(folder / "sparse/0", "1 1 0 0 0 0 0 0 1 a.png\n\n");
  fs::create_directories(folder / "images");
  for (const char* way : {"sparse/0", "sparse/0/", "sparse/0/.", "images/../sparse/0/"}) {
    const SourceCapture source = readColmap(folder / way);
    ASSERT_EQ(source.capture.photos.size(), 1u) << way;
    EXPECT_EQ(source.capture.photos[0].image, folder / "images/a.png") << way;
  }
}

TEST(Colmap, HasMasksBesideItsImagesOrAmongThem) {
  for (const std::string images : {"images/", ""}) {
    const TemporaryFolder folder;
    writeTextModel(folder / "flight/sparse/0", "1 1 0 0 0 0 0 0 1 a.png\n\n");
    fs::create_directories(folder / "flight" / images);
    writeFileAtomically(folder / "flight/masks/a.png", "a mask");
    writeFileAtomically(folder / "masks/a.png", "that of something else");
    for (const char* way : {"flight", "flight/"})
      EXPECT_EQ(readColmap(folder / way).capture.photos.at(0).mask, folder / "flight/masks/a.png") << images << way;
  }
}

// Of separate models, not the one with the largest file: photos differ in their numbers of features.
TEST(Colmap, IsTheModelWithTheMostPhotos) {
  const TemporaryFolder folder;
  const std::string points(1000, ' ');
  writeTextModel(folder / "sparse/0", "# a comment\n1 1 0 0 0 0 0 0 1 a.png\n" + points + "\n");
  writeTextModel(folder / "sparse/1", "1 1 0 0 0 0 0 0 1 b.png\n\n2 1 0 0 0 0 0 0 1 c.png\n\n");
  EXPECT_EQ(findColmapModel(folder.path()), folder / "sparse/1");
  const auto binary = [&](const char* name, uint64_t photos, size_t bytes) {
    std::string text(bytes, '\0');
    std::memcpy(text.data(), &photos, sizeof photos);
    writeFileAtomically(folder / name / "cameras.bin", "");
    writeFileAtomically(folder / name / "images.bin", text);
  };
  binary("sparse/2", 40, 10000);
  binary("sparse/3", 60, 500);
  EXPECT_EQ(findColmapModel(folder.path()), folder / "sparse/3");
}

TEST(Colmap, NamesTheFolderOfADamagedModel) {
  const TemporaryFolder folder;
  writeFileAtomically(folder / "cameras.bin", std::string_view("\x01\0\0\0", 4));
  writeFileAtomically(folder / "images.bin", std::string_view(""));
  try {
    readColmap(folder.path());
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.reason(), "cameras.bin: ends before its first count");
  }
}

}  // namespace
}  // namespace tessera

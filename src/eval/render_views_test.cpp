#include "eval/render_views.h"

#include <gtest/gtest.h>

#include <Eigen/LU>

#include "base/error.h"
#include "base/image_io.h"
#include "eval/evaluate.h"
#include "eval/testing/fake_capture.h"

namespace tessera {
namespace {

// Renders images of a uniform grey of 10 times the number of the photo, in bytes.
FakeRenderer greyByPhoto() {
  return FakeRenderer([](const Camera& camera, int photo) {
    const float grey = static_cast<float>(10 * photo) / 255;
    return RenderedView{ImageF(camera.width, camera.height, 3, grey), ImageF(camera.width, camera.height, 1, 1.0f),
                        ImageF(camera.width, camera.height, 1, 1.0f)};
  });
}

TEST(RenderViews, WritesPhotosOfTheSameNameInDifferentFoldersSeparately) {
  FakeCapture fake("render_names");
  const std::vector<std::string> photos = {"cam0/1.jpg",   "cam1/1.jpg", "train/r_0.png",
                                           "test/r_0.png", "a.jpg",      "a.png"};
  for (const std::string& name : photos) fake.add(name, ImageU8(64, 48, 3));
  FakeRenderer renderer = greyByPhoto();
  const fs::path out = fake.capture.root / "out";
  size_t calls = 0;
  RenderViewsOptions options;
  options.onView = [&](size_t done) { EXPECT_EQ(done, ++calls); };
  renderViews(renderer, viewsOfCapture(fake.capture, std::nullopt), out, options);
  EXPECT_EQ(calls, photos.size());
  const std::vector<std::string> pictures = {"cam0/1.png",   "cam1/1.png", "train/r_0.png",
                                             "test/r_0.png", "a.png",      "a.png.png"};
  for (size_t i = 0; i < pictures.size(); ++i) {
    EXPECT_EQ(readImage(out / pictures[i]).image.pixels[0], 10 * i) << pictures[i];
  }
  fake.capture.photos[0].name = "../../escaped.jpg";
  EXPECT_THROW(renderViews(renderer, viewsOfCapture(fake.capture, std::nullopt), out, {}), Error);
}

TEST(RenderViews, RendersOnlyTheRequestedSplit) {
  FakeCapture fake("render_splits");
  fake.add("learned.png", ImageU8(64, 48, 3), Split::train);
  fake.add("watched.png", ImageU8(64, 48, 3), Split::validation);
  fake.add("judged.png", ImageU8(64, 48, 3), Split::test);
  for (const auto& [name, photo] :
       {std::pair("train", "learned.png"), {"validation", "watched.png"}, {"test", "judged.png"}}) {
    const auto views = viewsOfCapture(fake.capture, *splitFromName(name));
    ASSERT_EQ(views.size(), 1u) << name;
    EXPECT_EQ(views[0].name, photo);
  }
  EXPECT_EQ(viewsOfCapture(fake.capture, std::nullopt).size(), 3u);
  EXPECT_FALSE(splitFromName("all"));
  fake.capture.photos.pop_back();
  EXPECT_THROW(viewsOfCapture(fake.capture, Split::test), Error);
}

TEST(RenderViews, CompositesViewsOverTheBackgroundInTheRequestedSize) {
  FakeCapture fake("render_background");
  fake.add("a.png", ImageU8(64, 48, 3));
  FakeRenderer renderer([](const Camera& camera, int) {
    return RenderedView{ImageF(camera.width, camera.height, 3, 0.25f), ImageF(camera.width, camera.height, 1, 0.5f),
                        ImageF(camera.width, camera.height, 1)};
  });
  renderer.colourBehind = {0, 0.5f, 1};
  RenderViewsOptions options;
  options.width = 10;
  options.height = 7;  // rounded from 7.5
  const fs::path out = fake.capture.root / "out";
  renderViews(renderer, viewsOfCapture(fake.capture, Split::test), out, options);
  const ImageU8 picture = readImage(out / "a.png").image;
  EXPECT_EQ(picture.width, 10);
  EXPECT_EQ(picture.height, 7);
  EXPECT_EQ(std::vector<uint8_t>(picture.pixels.begin(), picture.pixels.begin() + 3),
            (std::vector<uint8_t>{64, 128, 191}));
}

TEST(RenderViews, RefusesSizesThatStretchAndLensesThatCannotBeDrawn) {
  FakeCapture fake("render_shape");
  fake.add("a.png", ImageU8(64, 48, 3));
  fake.add("b.png", ImageU8(64, 48, 3));
  int rendered = 0;
  FakeRenderer renderer([&rendered](const Camera& camera, int) {
    ++rendered;
    return makeEmptyView(camera);
  });
  std::vector<NamedView> views = viewsOfCapture(fake.capture, Split::test);
  std::swap(views[1].camera.width, views[1].camera.height);
  const fs::path out = fake.capture.root / "out";
  const auto refusal = [&](const fs::path& to, const RenderViewsOptions& options) {
    try {
      renderViews(renderer, views, to, options);
    } catch (const Error& error) {
      return error.subject() + ": " + error.reason();
    }
    return std::string();
  };
  RenderViewsOptions options;
  options.width = 32;
  options.height = 24;
  EXPECT_EQ(refusal(out, options), "b.png: is 48x64 pixels large, and would be stretched to 32x24");
  EXPECT_EQ(refusal(fake.capture.root / "all.MP4", {}),
            "b.png: is 48x64 pixels large, and would be stretched to 64x48");
  EXPECT_NE(refusal(fake.capture.root / "all.webm", {}), "");
  renderer.refusal = "has the lens of a fish";
  EXPECT_EQ(refusal(out, {}), "a.png: has the lens of a fish");
  EXPECT_EQ(rendered, 0);
  renderer.refusal.clear();
  EXPECT_EQ(refusal(out, {}), "");
  EXPECT_EQ(rendered, 2);
}

Mat4d similarity(double scale, double angle, const Vec3d& translation) {
  Mat4d matrix = Mat4d::Identity();
  matrix.topLeftCorner<3, 3>() = scale * Eigen::AngleAxisd(angle, Vec3d(1, -2, 0.5).normalized()).toRotationMatrix();
  matrix.topRightCorner<3, 1>() = translation;
  return matrix;
}

// Transforms a pose by a similarity, without its scale in the rotation.
Pose moved(const Mat4d& matrix, double scale, const Pose& pose) {
  return {matrix.topLeftCorner<3, 3>() * pose.rotation / scale, (matrix * pose.translation.homogeneous()).head<3>()};
}

TEST(RenderViews, TransformsAPathIntoTheWorldOfTheCapture) {
  const Mat4d sourceFromWorld = similarity(3, 0.7, {100, -20, 4});
  const Mat4d pathFromSource = similarity(0.02, -1.9, {-2, 0.1, 0.3});
  std::vector<Pose> poses;
  CameraPath path;
  path.width = 40;
  path.height = 30;
  path.pathFromSource = pathFromSource;
  for (int i = 0; i < 3; ++i) {
    poses.push_back({Eigen::AngleAxisd(0.4 + i, Vec3d(3, 1, 2).normalized()).toRotationMatrix(), Vec3d(i, 2, -1)});
    path.views.push_back({moved(pathFromSource, 0.02, moved(sourceFromWorld, 3, poses.back())), 60.0 + i});
  }
  const std::vector<NamedView> views = viewsOfPath(path, sourceFromWorld);
  ASSERT_EQ(views.size(), 3u);
  EXPECT_EQ(views[0].name, "00000");
  EXPECT_EQ(views[2].name, "00002");
  for (size_t i = 0; i < views.size(); ++i) {
    EXPECT_TRUE(views[i].worldFromCamera.rotation.isApprox(poses[i].rotation, 1e-9));
    EXPECT_LT((views[i].worldFromCamera.translation - poses[i].translation).norm(), 1e-9);
    EXPECT_EQ(views[i].camera, path.makeViewCamera(path.views[i]));
  }
}

}  // namespace
}  // namespace tessera

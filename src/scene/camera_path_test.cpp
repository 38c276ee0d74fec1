#include "scene/camera_path.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <numbers>

#include "base/error.h"

namespace tessera {
namespace {

// A path as the viewer writes it; the camera is at (1, 2, 3) and looks along +y with z up.
constexpr const char* kFromViewer = R"({
  "keyframes": [{"matrix": "[]", "fov": 60}], "camera_type": "perspective", "render_height": 540, "render_width": 960,
  "camera_path": [
    {"camera_to_world": [1, 0, 0, 1,  0, 0, -1, 2,  0, 1, 0, 3,  0, 0, 0, 1], "fov": 90, "aspect": 1.7777},
    {"camera_to_world": [1, 0, 0, 1,  0, 0, -1, 2.5,  0, 1, 0, 3,  0, 0, 0, 1], "fov": 60, "aspect": 1.7777}],
  "fps": 24, "seconds": 4, "smoothness_value": 0.5, "is_cycle": false, "crop": null})";

std::string withFrame(const std::string& frame) {
  return R"({"camera_path": [)" + frame + "]}";
}

TEST(CameraPath, ReadsWhatTheViewerWrites) {
  const auto path = decodeCameraPath(kFromViewer);
  ASSERT_TRUE(path);
  EXPECT_EQ(path->width, 960);
  EXPECT_EQ(path->height, 540);
  EXPECT_EQ(path->framesPerSecond, 24);
  EXPECT_EQ(path->seconds, 4);
  ASSERT_EQ(path->views.size(), 2u);
  const Pose& pose = path->views[0].worldFromCamera;
  EXPECT_TRUE((pose * Vec3d(0, 0, 1)).isApprox(Vec3d(1, 3, 3)));  // forward is +y
  EXPECT_TRUE((pose * Vec3d(1, 0, 0)).isApprox(Vec3d(2, 2, 3)));  // right is +x
  EXPECT_TRUE((pose * Vec3d(0, 1, 0)).isApprox(Vec3d(1, 2, 2)));  // down is −z
  const Camera camera = path->makeViewCamera(path->views[0]);
  EXPECT_EQ(camera.width, 960);
  EXPECT_NEAR(camera.focalX(), 270, 1e-9);  // 90 degrees from the top edge to the bottom edge
  EXPECT_NEAR(camera.focalY(), 270, 1e-9);
  EXPECT_EQ(camera.centreX(), 480);
  EXPECT_EQ(camera.centreY(), 270);
  EXPECT_NEAR(path->makeViewCamera(path->views[1]).focalY(), 270 / std::tan(std::numbers::pi / 6), 1e-9);
}

TEST(CameraPath, ReadsBackWhatItWrote) {
  CameraPath path;
  path.width = 321;
  path.height = 200;
  path.framesPerSecond = 29.97;
  path.seconds = 2.5;
  path.fisheye = true;
  const Mat3d rotation = Eigen::AngleAxisd(1.1, Vec3d(1, 2, 3).normalized()).toRotationMatrix();
  path.views.push_back({{rotation, Vec3d(1e6, -2, 0.25)}, 72.5});
  const fs::path file = fs::temp_directory_path() / ("tessera_path_" + std::to_string(::getpid()) + ".json");
  writeCameraPath(file, path);
  const CameraPath read = readCameraPath(file);
  fs::remove(file);
  EXPECT_EQ(read.width, 321);
  EXPECT_EQ(read.height, 200);
  EXPECT_EQ(read.framesPerSecond, 29.97);
  EXPECT_EQ(read.seconds, 2.5);
  EXPECT_EQ(read.makeViewCamera(read.views[0]).lens, LensModel::openCvFisheye);
  EXPECT_TRUE(read.views[0].worldFromCamera.rotation.isApprox(rotation, 1e-12));
  EXPECT_EQ(read.views[0].worldFromCamera.translation, Vec3d(1e6, -2, 0.25));
  EXPECT_EQ(read.views[0].verticalFieldOfView, 72.5);
}

TEST(CameraPath, TakesNestedMatricesAndDefaults) {
  const auto path =
      decodeCameraPath(withFrame(R"({"camera_to_world": [[1, 0, 0, 5], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]})"));
  ASSERT_TRUE(path);
  EXPECT_EQ(path->width, 1920);
  EXPECT_EQ(path->views[0].worldFromCamera.translation.x(), 5);
  EXPECT_EQ(path->views[0].verticalFieldOfView, 50);
}

TEST(CameraPath, MakesRoundedRotationsExact) {
  const auto path = decodeCameraPath(
      withFrame(R"({"camera_to_world": [0.707, -0.707, 0, 0, 0.707, 0.707, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]})"));
  ASSERT_TRUE(path);
  const Mat3d& rotation = path->views[0].worldFromCamera.rotation;
  EXPECT_TRUE((rotation.transpose() * rotation).isIdentity(1e-12));
}

TEST(CameraPath, RejectsInvalidPaths) {
  const std::string identity = R"("camera_to_world": [1,0,0,0, 0,1,0,0, 0,0,1,0, 0,0,0,1])";
  EXPECT_TRUE(decodeCameraPath(withFrame("{" + identity + "}")));
  for (const std::string& text :
       {std::string(),
        std::string("["),
        std::string("[]"),
        std::string("{}"),
        withFrame(""),
        withFrame("3"),
        withFrame("{}"),
        withFrame(R"({"camera_to_world": [1,0,0,0, 0,1,0,0, 0,0,1,0, 0,0,0]})"),        // fifteen numbers
        withFrame(R"({"camera_to_world": [1,0,0,0, 0,1,0,0, 0,0,1,0, 0,0,0,1,1]})"),    // seventeen
        withFrame(R"({"camera_to_world": [2,0,0,0, 0,2,0,0, 0,0,2,0, 0,0,0,1]})"),      // scaled
        withFrame(R"({"camera_to_world": [1,0,0,0, 0,1,0,0, 0,0,-1,0, 0,0,0,1]})"),     // mirrored
        withFrame(R"({"camera_to_world": [1,0,0,1e300, 0,1,0,0, 0,0,1,0, 0,0,0,1]})"),  // out of bounds
        withFrame(R"({"camera_to_world": [1,0,0,null, 0,1,0,0, 0,0,1,0, 0,0,0,1]})"),   // NaN as JSON has it
        withFrame("{" + identity + R"(, "fov": 0})"),
        withFrame("{" + identity + R"(, "fov": 180})"),
        withFrame("{" + identity + R"(, "fov": "wide"})"),
        R"({"render_width": 0, "camera_path": [{)" + identity + "}]}",
        R"({"render_width": 1e9, "camera_path": [{)" + identity + "}]}",
        R"({"fps": 0, "camera_path": [{)" + identity + "}]}",
        R"({"camera_type": "equirectangular", "camera_path": [{)" + identity + "}]}",
        R"({"camera_type": 3, "camera_path": [{)" + identity + "}]}",
        std::string(100000, '[')}) {
    EXPECT_FALSE(decodeCameraPath(text)) << text.substr(0, 120);
  }
}

TEST(CameraPath, SaysWhereAndWhyItIsRefused) {
  const std::string frame = R"({"camera_to_world": [1,0,0,0, 0,1,0,0, 0,0,1,0, 0,0,0,1])";
  const auto describeFlaw = [](const std::string& text) {
    TextFlaw flaw;
    EXPECT_FALSE(decodeCameraPath(text, &flaw));
    return flaw.place + ": " + flaw.reason;
  };
  EXPECT_EQ(describeFlaw("{\n  \"fps\": 24,\n  oops"), "line 3, column 3: is not JSON");
  EXPECT_EQ(describeFlaw(withFrame(frame + "}, " + frame + R"(, "fov": 0})")),
            "camera_path[1].fov: is not a number from 0.1 to 179");
  EXPECT_EQ(describeFlaw(withFrame(R"({"camera_to_world": [2,0,0,0, 0,2,0,0, 0,0,2,0, 0,0,0,1]})")),
            "camera_path[0].camera_to_world: does not begin with a rotation: it scales, shears or mirrors");
  EXPECT_EQ(describeFlaw(R"({"camera_type": "equirectangular"})"),
            "camera_type: is neither perspective nor fisheye, which alone are rendered");
  EXPECT_EQ(describeFlaw("{}"), "camera_path: is missing, empty, or not a list of frames");
}

// A file as nerfstudio writes it for a capture whose poses were rotated from COLMAP's axes.
constexpr const char* kTransforms =
    R"({"transform": [[0, 1, 0, 0.5], [1, 0, 0, -0.25], [0, 0, -1, 2]], "scale": 0.125})";

TEST(CameraPath, DecodesTheSimilarityOfADataparser) {
  const auto dataparserFromSource = decodeDataparserTransforms(kTransforms);
  ASSERT_TRUE(dataparserFromSource);
  // s · (transform · x): the translation is scaled too.
  const Vec3d moved = (*dataparserFromSource * Vec3d(3, 4, 5).homogeneous()).head<3>();
  EXPECT_TRUE(moved.isApprox(0.125 * Vec3d(4 + 0.5, 3 - 0.25, -5 + 2)));
  EXPECT_EQ(dataparserFromSource->row(3), Mat4d::Identity().row(3));
  const auto unscaled = decodeDataparserTransforms(R"({"transform": [1,0,0,7, 0,1,0,0, 0,0,1,0]})");
  ASSERT_TRUE(unscaled);
  EXPECT_EQ((*unscaled)(0, 3), 7);
}

TEST(CameraPath, RejectsInvalidDataparserTransforms) {
  const std::string turned = R"("transform": [[1,0,0,0],[0,1,0,0],[0,0,1,0]])";
  EXPECT_TRUE(decodeDataparserTransforms("{" + turned + R"(, "scale": 2})"));
  for (const std::string& text :
       {std::string(), std::string("[]"), std::string("{}"), std::string(R"({"scale": 2})"),
        "{" + turned + R"(, "scale": 0})", "{" + turned + R"(, "scale": -1})", "{" + turned + R"(, "scale": 1e300})",
        "{" + turned + R"(, "scale": "one"})", "{" + turned + R"(, "scale": null})",
        std::string(R"({"transform": [[1,0,0,0],[0,1,0,0]], "scale": 1})"),
        std::string(R"({"transform": [[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]], "scale": 1})"),
        std::string(R"({"transform": [[2,0,0,0],[0,1,0,0],[0,0,1,0]], "scale": 1})"),
        std::string(R"({"transform": [[1,0,0,0],[0,1,0,0],[0,0,-1,0]], "scale": 1})"),
        std::string(R"({"transform": [[1,0,0,1e300],[0,1,0,0],[0,0,1,0]], "scale": 1})"), std::string(100000, '[')}) {
    EXPECT_FALSE(decodeDataparserTransforms(text)) << text.substr(0, 120);
  }
}

TEST(CameraPath, UsesTheNamedOrNeighbouringDataparserTransforms) {
  const fs::path folder = fs::temp_directory_path() / ("tessera_dataparser_" + std::to_string(::getpid()));
  const fs::path file = folder / "path.json", beside = folder / "dataparser_transforms.json";
  writeFileAtomically(file, std::string_view(kFromViewer));
  EXPECT_EQ(readCameraPath(file).pathFromSource, Mat4d::Identity());
  EXPECT_TRUE(readCameraPath(file).fromViewer);
  writeFileAtomically(beside, std::string_view(kTransforms));
  EXPECT_EQ(readCameraPath(file).pathFromSource, *decodeDataparserTransforms(kTransforms));
  const std::string other = R"({"transform": [[1,0,0,0],[0,1,0,0],[0,0,1,0]], "scale": 4})";
  writeFileAtomically(folder / "named.json", other);
  EXPECT_EQ(readCameraPath(file, folder / "named.json").pathFromSource, *decodeDataparserTransforms(other));
  // A path of tessera's viewer is in the world of the capture.
  const std::string ours = withFrame(R"({"camera_to_world": [1,0,0,0, 0,1,0,0, 0,0,1,0, 0,0,0,1]})");
  writeFileAtomically(folder / "ours.json", ours);
  EXPECT_EQ(readCameraPath(folder / "ours.json").pathFromSource, Mat4d::Identity());
  writeFileAtomically(beside, std::string_view("{}"));
  try {
    readCameraPath(file);
    FAIL() << "no error";
  } catch (const Error& error) {
    EXPECT_EQ(error.subject(), beside.string());
  }
  EXPECT_THROW(readCameraPath(file, folder / "missing.json"), Error);
  fs::remove_all(folder);
}

TEST(CameraPath, NamesAFileThatIsNotOne) {
  const fs::path file = fs::temp_directory_path() / ("tessera_no_path_" + std::to_string(::getpid()) + ".json");
  writeFileAtomically(file, std::string_view("{}"));
  EXPECT_THROW(readCameraPath(file), Error);
  fs::remove(file);
}

}  // namespace
}  // namespace tessera

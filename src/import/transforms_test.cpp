#include <gtest/gtest.h>

#include <cmath>

#include "base/error.h"
#include "import/capture_reader.h"
#include "import/testing/test_support.h"
#include "import/transforms_json.h"
#include "scene/capture_writer.h"

namespace tessera {
namespace {

const std::string kIdentity = "[[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]";

std::string frame(const std::string& file, const std::string& matrix = kIdentity, const std::string& more = "") {
  return "{\"file_path\":\"" + file + "\",\"transform_matrix\":" + matrix + more + "}";
}

Camera decodeCamera(const std::string& keys, int width = 100, int height = 80) {
  std::string reason;
  const auto file = decodeTransforms("{" + keys + ",\"frames\":[" + frame("a") + "]}", reason);
  EXPECT_TRUE(file.has_value()) << reason;
  const auto camera = cameraFromIntrinsics(file->frames[0].intrinsics, width, height, reason);
  EXPECT_TRUE(camera.has_value()) << reason;
  return camera.value_or(Camera{});
}

// A source of the frames, which name a.png, b.png, ... in `folder`, and the warnings that were logged while it was
// read.
struct Read {
  SourceCapture source;
  std::string warnings;
  bool warned(const std::string& text) const { return warnings.find(text) != std::string::npos; }
};

Read readSource(const TemporaryFolder& folder, const std::string& keys, const std::vector<std::string>& frames) {
  for (const char* name : {"a.png", "b.png", "c.png", "d.png"}) writePng(folder / name, gradientPicture(8, 8));
  std::string json = "{\"fl_x\":9" + keys + ",\"frames\":[";
  for (size_t i = 0; i < frames.size(); ++i) json += (i > 0 ? "," : "") + frames[i];
  writeFileAtomically(folder / "transforms.json", json + "]}");
  testing::internal::CaptureStderr();
  Read read{readTransforms(findTransforms(folder.path())), ""};
  read.warnings = testing::internal::GetCapturedStderr();
  return read;
}

std::string lensTrouble(const std::string& keys) {
  std::string reason;
  const auto file = decodeTransforms("{" + keys + ",\"frames\":[" + frame("a") + "]}", reason);
  EXPECT_TRUE(file.has_value()) << reason;
  EXPECT_FALSE(cameraFromIntrinsics(file->frames[0].intrinsics, 100, 80, reason).has_value());
  return reason;
}

TEST(Transforms, ReadsEveryWayOfGivingAFocalLength) {
  EXPECT_NEAR(decodeCamera(R"("camera_angle_x":1.5707963267948966)").focalX(), 50, 1e-9);
  EXPECT_NEAR(decodeCamera(R"("camera_angle_x":1.5707963267948966)").focalY(), 50, 1e-9);
  EXPECT_NEAR(decodeCamera(R"("y_fov":90)").focalX(), 40, 1e-9);
  const Camera both = decodeCamera(R"("fl_x":70,"fl_y":71,"camera_angle_x":1,"w":200,"h":160,"cx":99.5)");
  EXPECT_EQ(both.focalX(), 70);
  EXPECT_EQ(both.focalY(), 71);
  EXPECT_EQ(both.centreX(), 99.5);
  EXPECT_EQ(both.centreY(), 80);
  EXPECT_EQ(both.width, 200);
}

TEST(Transforms, ReadsLenses) {
  EXPECT_EQ(decodeCamera(R"("fl_x":70)").lens, LensModel::pinhole);
  const Camera openCv = decodeCamera(R"("fl_x":70,"k1":0.1,"k2":0.2,"p1":0.3,"p2":0.4)");
  EXPECT_EQ(openCv.lens, LensModel::openCv);
  EXPECT_EQ(openCv.parameters[6], 0.3);
  const Camera fisheye = decodeCamera(R"("fl_x":70,"k1":0.1,"k4":0.2,"is_fisheye":true)");
  EXPECT_EQ(fisheye.lens, LensModel::openCvFisheye);
  EXPECT_EQ(fisheye.parameters[7], 0.2);
  EXPECT_EQ(decodeCamera(R"("fl_x":70,"camera_model":"OPENCV_FISHEYE")").lens, LensModel::openCvFisheye);
  const Camera sixth = decodeCamera(R"("fl_x":70,"k3":0.1,"camera_model":"OPENCV")");
  EXPECT_EQ(sixth.lens, LensModel::fullOpenCv);
  EXPECT_EQ(sixth.parameters[8], 0.1);
}

TEST(Transforms, RejectsUnsupportedLenses) {
  EXPECT_NE(lensTrouble(R"("k1":0.1)").find("no focal length"), std::string::npos);
  EXPECT_NE(lensTrouble(R"("fl_x":70,"k4":0.1)").find("k4"), std::string::npos);
  EXPECT_NE(lensTrouble(R"("fl_x":70,"camera_model":"EQUIRECTANGULAR")").find("EQUIRECTANGULAR"), std::string::npos);
  EXPECT_NE(lensTrouble(R"("fl_x":70,"is_fisheye":true,"ftheta_p0":0,"ftheta_p1":1)").find("FTHETA"),
            std::string::npos);
  EXPECT_NE(lensTrouble(R"("fl_x":70,"latlong":true)").find("LATLONG"), std::string::npos);
  EXPECT_EQ(decodeCamera(R"("fl_x":70,"latlong":false)").lens, LensModel::pinhole);
}

TEST(Transforms, LetsAFrameOverrideTheFile) {
  std::string reason;
  const auto file = decodeTransforms(R"({"fl_x":70,"w":100,"unknown":{"a":[1]},"frames":[)" +
                                         frame("a", kIdentity, R"(,"fl_x":90,"sharpness":3)") + "]}",
                                     reason);
  ASSERT_TRUE(file.has_value()) << reason;
  EXPECT_EQ(file->frames[0].intrinsics.numbers.at("fl_x"), 90);
  EXPECT_EQ(file->frames[0].intrinsics.numbers.at("w"), 100);
}

TEST(Transforms, NamesWhatIsMissing) {
  std::string reason;
  EXPECT_FALSE(decodeTransforms("{]", reason).has_value());
  EXPECT_EQ(reason, "is not JSON");
  EXPECT_FALSE(decodeTransforms("[]", reason).has_value());
  EXPECT_FALSE(decodeTransforms("{}", reason).has_value());
  EXPECT_EQ(reason, "frames: is missing");
  EXPECT_FALSE(decodeTransforms("{\"frames\":[{\"file_path\":\"a\"}]}", reason).has_value());
  EXPECT_EQ(reason, "frames[0]: has no 4 x 4 transform_matrix");
  EXPECT_FALSE(decodeTransforms("{\"frames\":[{}]}", reason).has_value());
}

TEST(Transforms, DropsInvalidPosesAndPathsThatLeaveTheFolder) {
  const TemporaryFolder folder;
  writePng(folder / "a.png", gradientPicture(8, 8));
  const std::string nan = "[[NaN,0,0,0],[0,1,0,0],[0,0,1,-Infinity],[0,0,0,1]]";
  const std::string scaled = "[[0.01,0,0,0],[0,0.01,0,0],[0,0,0.01,0],[0,0,0,1]]";
  const std::string mirrored = "[[-1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]";
  writeFileAtomically(folder / "transforms.json", R"({"fl_x":9,"note":"NaN is \" not here","frames":[)" +
                                                      frame("a.png") + "," + frame("a.png", nan) + "," +
                                                      frame("a.png", scaled) + "," + frame("a.png", mirrored) + "," +
                                                      frame("../a.png") + "," + frame("/etc/passwd") + "]}");
  testing::internal::CaptureStderr();
  const SourceCapture source = readTransforms(findTransforms(folder.path()));
  const std::string warnings = testing::internal::GetCapturedStderr();
  EXPECT_EQ(source.capture.photos.size(), 1u);
  EXPECT_NE(warnings.find("3 photos have a pose"), std::string::npos) << warnings;
  EXPECT_NE(warnings.find("2 photos have paths that leave the folder"), std::string::npos) << warnings;
}

TEST(Transforms, DropsFinitePosesThatAreOutOfBounds) {
  const TemporaryFolder folder;
  const Read read = readSource(folder, "",
                               {frame("a.png", "[[1,0,0,1e12],[0,1,0,0],[0,0,1,0],[0,0,0,1]]"),
                                frame("b.png", "[[1,0,0,0],[0,1,0,-1.1e12],[0,0,1,0],[0,0,0,1]]"),
                                frame("c.png", "[[1,0,0,0],[0,1,0,0],[0,0,1,1e300],[0,0,0,1]]")});
  ASSERT_EQ(read.source.capture.photos.size(), 1u);
  EXPECT_EQ(read.source.capture.photos[0].name, "a.png");
  EXPECT_TRUE(read.warned("2 photos have a pose")) << read.warnings;
}

TEST(Transforms, SaysWhichMasksAndDepthMapsLeaveTheFolder) {
  const TemporaryFolder folder;
  const Read read = readSource(folder, "",
                               {frame("a.png", kIdentity, R"(,"mask_path":"../m.png","depth_file_path":"/d.exr")"),
                                frame("b.png", kIdentity, R"(,"mask_path":"/etc/m.png")"), frame("c.png")});
  ASSERT_EQ(read.source.capture.photos.size(), 3u);
  EXPECT_TRUE(read.source.capture.photos[1].mask.empty());
  EXPECT_TRUE(
      read.warned("2 masks have paths that leave the folder: those photos train unmasked (../m.png, /etc/m.png)"))
      << read.warnings;
  EXPECT_TRUE(read.warned("1 depth maps have paths that leave the folder; ignored (/d.exr)")) << read.warnings;
}

TEST(Transforms, MatchesSplitNamesInAnyPathNotation) {
  const TemporaryFolder folder;
  const Read read = readSource(
      folder, R"(,"train_filenames":["./d.png"],"val_filenames":["x/../c.png"],"test_filenames":["a.png",".\\b.png"])",
      {frame("./a.png"), frame("b.png"), frame("c.png"), frame("d.png")});
  std::vector<Split> splits;
  for (const Photo& photo : read.source.capture.photos) splits.push_back(photo.split);
  EXPECT_EQ(splits, (std::vector<Split>{Split::test, Split::test, Split::validation, Split::train}));
  EXPECT_TRUE(read.source.hasOwnSplit);
  EXPECT_FALSE(read.source.splitError.has_value());
  EXPECT_EQ(read.warnings, "");
}

TEST(Transforms, ReportsSplitNamesWithoutFrameAndFramesWithoutSplit) {
  const TemporaryFolder folder;
  const Read read =
      readSource(folder, R"(,"train_filenames":["a.png"],"test_filenames":["b.png","e.png","images/b.png"])",
                 {frame("a.png"), frame("b.png"), frame("c.png"), frame("d.png")});
  EXPECT_TRUE(read.warned("test_filenames: 2 of 3 names are of no frame (e.png, images/b.png)")) << read.warnings;
  EXPECT_TRUE(read.warned("2 frames are in no list of a split; they train (c.png, d.png)")) << read.warnings;
  EXPECT_FALSE(read.source.splitError.has_value());
  EXPECT_EQ(read.source.capture.photos.at(1).split, Split::test);
  // Where only held-out photos are listed, the others are for training, without a warning.
  EXPECT_EQ(readSource(folder, R"(,"test_filenames":["b.png"])", {frame("a.png"), frame("b.png")}).warnings, "");
}

TEST(Transforms, RejectsSplitListsThatMatchNoFrame) {
  const TemporaryFolder folder;
  const Read read = readSource(folder, R"(,"train_filenames":["a.png"],"test_filenames":["images/b.png"])",
                               {frame("a.png"), frame("b.png")});
  ASSERT_TRUE(read.source.splitError.has_value());
  EXPECT_EQ(read.source.splitError->place(), "test_filenames");
  EXPECT_NE(read.source.splitError->reason().find("images/b.png"), std::string::npos);
}

TEST(Transforms, ReportsEachUnknownKeyOnce) {
  const TemporaryFolder folder;
  const std::string more = R"(,"blur":1,"colmap_im_id":3,"sharpness":2,"rotation":0.1)";
  const Read few = readSource(
      folder, R"(,"aabb_scale":4,"scale":1,"offset":[0,0,0],"near":0,"far":9,"k5":0,"camera_angle_y":1,"wind":"west")",
      {frame("a.png", kIdentity, more), frame("b.png", kIdentity, more)});
  EXPECT_TRUE(few.warned("transforms.json: ignored, as unknown to tessera: blur, wind\n")) << few.warnings;
  EXPECT_EQ(few.warnings.find("blur"), few.warnings.rfind("blur"));
  std::string many;
  for (char c = 'a'; c <= 'm'; ++c) many += std::string(",\"key_") + c + "\":0";
  EXPECT_TRUE(readSource(folder, many, {frame("a.png")}).warned("key_i, key_j and 3 more\n"));
}

TEST(Transforms, ReportsTheConsequencesOfUnsupportedKeys) {
  const TemporaryFolder folder;
  const Read read =
      readSource(folder, R"(,"rolling_shutter":[0,0,0.02,0],"from_na":true)",
                 {frame("a.png", kIdentity, R"(,"time":0.0)"), frame("b.png", kIdentity, R"(,"time":0.5)")});
  EXPECT_TRUE(read.warned("rolling_shutter is not followed: every photo is treated as exposed at one instant"));
  EXPECT_TRUE(read.warned("from_na is not followed: poses are read with OpenGL axes"));
  EXPECT_TRUE(read.warned("time is not followed: the scene is treated as static"));
  EXPECT_EQ(
      readSource(folder, R"(,"rolling_shutter":[0,0,0,0],"from_na":false,"time":null)", {frame("a.png")}).warnings, "");
}

TEST(Transforms, ConvertsOpenGlAxes) {
  const TemporaryFolder folder;
  writePng(folder / "a.png", gradientPicture(8, 8));
  // The camera looks along world +y (backward = -y), up = +z, right = +x, with values rounded as in files.
  writeFileAtomically(
      folder / "transforms.json",
      R"({"fl_x":9,"frames":[)" + frame("a.png", "[[1,0.00001,0,5],[0,0,-1,6],[0,1,0,7],[0,0,0,1]]") + "]}");
  const SourceCapture source = readTransforms(findTransforms(folder.path()));
  const Pose& pose = source.capture.photos.at(0).worldFromCamera;
  EXPECT_NEAR((pose.rotation.col(2) - Vec3d(0, 1, 0)).norm(), 0, 1e-4);
  EXPECT_NEAR((pose.rotation.col(1) - Vec3d(0, 0, -1)).norm(), 0, 1e-4);
  EXPECT_EQ(pose.translation, Vec3d(5, 6, 7));
  EXPECT_NEAR((pose.rotation.transpose() * pose.rotation - Mat3d::Identity()).norm(), 0, 1e-14);
}

TEST(Transforms, ReadsBlendersThreeFilesWithoutExtensions) {
  const TemporaryFolder folder;
  for (const std::string split : {"train", "val", "test"}) {
    writePng(folder / split / "r_0.png", gradientPicture(8, 8, 4));
    writeFileAtomically(folder / ("transforms_" + split + ".json"),
                        "{\"camera_angle_x\":0.69,\"frames\":[" + frame("./" + split + "/r_0") + "]}");
  }
  const SourceCapture source = readTransforms(findTransforms(folder.path()));
  ASSERT_EQ(source.capture.photos.size(), 3u);
  EXPECT_TRUE(source.hasOwnSplit);
  EXPECT_EQ(source.capture.photos[2].split, Split::test);
  EXPECT_EQ(source.capture.photos[2].name, "test/r_0.png");
  EXPECT_EQ(source.capture.cameras.size(), 1u);
  EXPECT_EQ(source.capture.cameras[0].width, 8);
}

TEST(Transforms, TakesInstantNgpsDynamicMasksAsInverted) {
  const TemporaryFolder folder;
  writePng(folder / "images/a.png", gradientPicture(8, 8));
  writePng(folder / "images/dynamic_mask_a.png", ImageU8(8, 8, 1, 0));
  writeFileAtomically(folder / "transforms.json", "{\"fl_x\":9,\"frames\":[" + frame("images/a.png") + "]}");
  const SourceCapture source = readTransforms(findTransforms(folder.path()));
  EXPECT_EQ(source.capture.photos.at(0).mask, folder / "images/dynamic_mask_a.png");
  EXPECT_TRUE(source.maskIsInverted.at(0));
}

TEST(Transforms, KeepsTheWorldAfterAppliedTransform) {
  const TemporaryFolder folder;
  writePng(folder / "a.png", gradientPicture(8, 8));
  writeFileAtomically(folder / "transforms.json",
                      R"({"fl_x":9,"applied_transform":[[1,0,0,0],[0,0,1,0],[0,-1,0,0]],"applied_scale":2,"frames":[)" +
                          frame("a.png", "[[1,0,0,5],[0,1,0,6],[0,0,1,7],[0,0,0,1]]", R"(,"depth_file_path":"d.png")") +
                          "]}");
  const SourceCapture source = readTransforms(findTransforms(folder.path()));
  const Photo& photo = source.capture.photos.at(0);
  EXPECT_EQ(photo.worldFromCamera.translation, Vec3d(5, 6, 7));
  EXPECT_FLOAT_EQ(photo.depthUnit, 0.002f);
  const Vec3d inSource = (source.capture.sourceFromWorld * Vec3d(5, 6, 7).homogeneous()).head<3>();
  EXPECT_NEAR((inSource - Vec3d(2.5, -3.5, 3)).norm(), 0, 1e-12);
}

TEST(Transforms, InvertsAppliedScalesOfAnySize) {
  const TemporaryFolder folder;
  for (const double scale : {1e-11, 1e-5, 1e5}) {
    const std::string keys = R"(,"applied_transform":[[0,1,0,1],[1,0,0,2],[0,0,-1,3]],"applied_scale":)";
    const Read read = readSource(folder, keys + std::to_string(scale * 1e11) + "e-11", {frame("a.png")});
    // World x = scale × (source y + 1).
    const Vec3d inSource = (read.source.capture.sourceFromWorld * Vec3d(5 * scale, 0, 0).homogeneous()).head<3>();
    EXPECT_NEAR((inSource - Vec3d(-2, 4, 3)).norm(), 0, 1e-9) << scale;
    EXPECT_EQ(read.warnings, "");
  }
  // The transform may contain the scale itself.
  const Read read =
      readSource(folder, R"(,"applied_transform":[[1e-5,0,0,0],[0,1e-5,0,0],[0,0,1e-5,0]])", {frame("a.png")});
  EXPECT_NEAR(read.source.capture.sourceFromWorld(1, 1), 1e5, 1e-6);
  EXPECT_EQ(read.warnings, "");
}

TEST(Transforms, ReportsAppliedTransformsThatCannotBeInverted) {
  const TemporaryFolder folder;
  for (const char* matrix : {"[[1,0,0,0],[0,1,0,0],[0,0,0,0]]", "[[1,0,0,0],[0,1,0,0],[0,0,1,NaN]]", "[1,2,3]",
                             "[[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,0]]", "[[1,2,0,0],[2,4,0,0],[0,0,1,0]]"}) {
    const Read read =
        readSource(folder, R"(,"applied_scale":2,"applied_transform":)" + std::string(matrix), {frame("a.png")});
    EXPECT_TRUE(read.warned("applied_transform is not a 3 x 4 matrix that can be inverted; ignored")) << matrix;
    EXPECT_EQ(read.source.capture.sourceFromWorld(0, 0), 0.5) << matrix;
  }
  for (const char* scale : {"0", "-1", "1e-200", "1e300", "\"2\"", "NaN"}) {
    const Read read = readSource(folder, R"(,"applied_scale":)" + std::string(scale), {frame("a.png")});
    EXPECT_EQ(read.warned("applied_scale is not a number"), std::string(scale) != "NaN") << scale;
    EXPECT_EQ(read.source.capture.sourceFromWorld, Mat4d::Identity()) << scale;
  }
}

// Returns a capture with every kind of data, whose numbers have no short decimal representation.
Capture fullCapture(const fs::path& root) {
  Capture capture;
  capture.root = root;
  capture.cameras = {{8, 6, LensModel::openCv, {1.0 / 3, 0.1, 4.1, 3.2, 0.01, -0.02, 1e-17, 3e-3}},
                     {8, 6, LensModel::thinPrismFisheye, {5, 6, 4, 3, 1, 2, 3, 4, 5, 6, 7, 1.0 / 7}},
                     {8, 6, LensModel::simpleDivision, {5, 4, 3, -1.0 / 7}},
                     {8, 6, LensModel::division, {5, 6, 4, 3, 1.0 / 7}},
                     {8, 6, LensModel::eucm, {5, 6, 4, 3, 1.0 / 7, 1.1}}};
  for (int i = 0; i < 3; ++i) {
    Photo photo;
    photo.name = "images/" + std::to_string(i) + ".png";
    photo.image = root / photo.name;
    writePng(photo.image, gradientPicture(8, 6));
    photo.camera = i % 2;
    photo.split = static_cast<Split>(i);
    photo.worldFromCamera.rotation = Eigen::AngleAxisd(0.1 + i, Vec3d(1, 2, 3).normalized()).toRotationMatrix();
    photo.worldFromCamera.translation = Vec3d(1.0 / 3, -2e7, 1e-9 * i);
    capture.photos.push_back(photo);
  }
  Photo& rich = capture.photos[1];
  rich.mask = root / "masks/1.png";
  writePng(rich.mask, ImageU8(8, 6, 1, 255));
  rich.depth = root / "depths/1.exr";
  writeDepthExr(rich.depth, ImageF(8, 6, 1, 2.5f));
  rich.depthUnit = 0.3f;
  rich.exposure = -0.7;
  rich.orientation = 6;
  rich.gps = GpsFix{50.123456789012345, -0.1, 12.5, 40.1};
  capture.points = {{Vec3d(1.0 / 3, 2, 3), {9, 8, 7}, 0.4f}, {Vec3d(-1, 0, 1e-12), {}, 0}};
  capture.observations = {{0, 1, 1.5f, 2.25f, 0.1f}, {2, 0, 3, 4, 0.2f}};
  capture.geo = GeoFrame{1.0 / 3, -75, 12, Mat4d::Identity()};
  capture.geo->enuFromWorld.topLeftCorner<3, 3>() *= 1.25;
  capture.sourceFromWorld(0, 3) = 1e6 + 1.0 / 3;
  return capture;
}

TEST(Captures, OfEarlierVersionsGetAffineMaps) {
  const TemporaryFolder folder;
  Capture capture = fullCapture(folder.path());
  capture.sourceFromWorld(3, 3) = capture.geo->enuFromWorld(3, 3) = std::nextafter(1.0, 0.0);
  writeCapture(capture);
  const Capture read = readCapture(folder.path());
  EXPECT_EQ(read.sourceFromWorld(3, 3), 1);
  EXPECT_EQ(read.geo->enuFromWorld(3, 3), 1);
}

TEST(Captures, AreReadBackExactlyAsWritten) {
  const TemporaryFolder folder;
  const Capture written = fullCapture(folder.path());
  writeCapture(written);
  const Capture read = readCapture(folder.path());
  EXPECT_EQ(read.cameras, written.cameras);
  ASSERT_EQ(read.photos.size(), written.photos.size());
  for (size_t i = 0; i < read.photos.size(); ++i) {
    const Photo &a = read.photos[i], &b = written.photos[i];
    EXPECT_EQ(a.name, b.name);
    EXPECT_EQ(a.camera, b.camera);
    EXPECT_EQ(a.image, b.image);
    EXPECT_EQ(a.mask, b.mask);
    EXPECT_EQ(a.depth, b.depth);
    EXPECT_EQ(a.worldFromCamera.rotation, b.worldFromCamera.rotation);
    EXPECT_EQ(a.worldFromCamera.translation, b.worldFromCamera.translation);
    EXPECT_EQ(a.split, b.split);
    EXPECT_EQ(a.exposure, b.exposure);
    EXPECT_EQ(a.orientation, b.orientation);
    ASSERT_EQ(a.gps.has_value(), b.gps.has_value());
  }
  EXPECT_EQ(read.photos[1].depthUnit, 0.3f);
  EXPECT_EQ(read.photos[1].gps->latitude, written.photos[1].gps->latitude);
  EXPECT_EQ(read.photos[1].gps->relativeAltitude, 40.1);
  EXPECT_EQ(read.geo->enuFromWorld, written.geo->enuFromWorld);
  EXPECT_EQ(read.geo->latitude, written.geo->latitude);
  EXPECT_EQ(read.sourceFromWorld, written.sourceFromWorld);
  ASSERT_EQ(read.points.size(), 2u);
  EXPECT_EQ(read.points[0].xInWorld, written.points[0].xInWorld);
  EXPECT_EQ(read.points[0].colour, written.points[0].colour);
  ASSERT_EQ(read.observations.size(), 2u);
  EXPECT_EQ(read.observations[1].photo, 2u);
  EXPECT_EQ(read.observations[0].y, 2.25f);
}

TEST(Captures, UseNerfstudiosKeysForOneCamera) {
  const TemporaryFolder folder;
  Capture capture = fullCapture(folder.path());
  capture.cameras.resize(1);
  for (Photo& photo : capture.photos) photo.camera = 0;
  writeCapture(capture);
  std::string text = readTextFile(folder / "transforms.json"), reason;
  text.replace(text.find("\"tessera\""), 9, "\"unknown\"");  // hides our own keys, as from another program
  const auto file = decodeTransforms(text, reason);
  ASSERT_TRUE(file.has_value()) << reason;
  EXPECT_FALSE(file->isOurs);
  EXPECT_EQ(cameraFromIntrinsics(file->frames[0].intrinsics, 8, 6, reason), capture.cameras[0]);
  ASSERT_EQ(file->splitLists.size(), 3u);
  EXPECT_EQ(file->splitLists[2].names, std::vector<std::string>{"images/2.png"});
  EXPECT_EQ(file->pointFile, "points.ply");
}

TEST(Captures, AreNotReadFromOtherFolders) {
  const TemporaryFolder folder;
  EXPECT_THROW(readCapture(folder.path()), Error);
  writeFileAtomically(folder / "transforms.json", std::string_view("{\"frames\":[]}"));
  EXPECT_THROW(readCapture(folder.path()), Error);
  const Capture capture = fullCapture(folder.path());
  writeCapture(capture);
  fs::remove(capture.photos[2].image);
  try {
    readCapture(folder.path());
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.subject(), capture.photos[2].image.string());
  }
}

TEST(Captures, RejectSplitListsThatMatchNoPhoto) {
  const TemporaryFolder folder;
  writeCapture(fullCapture(folder.path()));
  std::string text = readTextFile(folder / "transforms.json");
  const size_t list = text.find("\"test_filenames\"");
  text.replace(text.find("images/2", list), 8, "images/7");
  writeFileAtomically(folder / "transforms.json", text);
  EXPECT_THROW(readCapture(folder.path()), Error);
  EXPECT_TRUE(isCapture(folder.path()));
}

TEST(Captures, RefuseObservationsOfPhotosThatDoNotExist) {
  const TemporaryFolder folder;
  Capture capture = fullCapture(folder.path());
  capture.observations[0].photo = 7;
  writeCapture(capture);
  EXPECT_THROW(readCapture(folder.path()), Error);
}

TEST(Captures, AreNotWrittenWithImagesOutsideTheirFolder) {
  const TemporaryFolder folder;
  Capture capture = fullCapture(folder.path());
  capture.root = folder / "inner";
  fs::create_directories(capture.root);
  EXPECT_THROW(writeCapture(capture), Error);
}

}  // namespace
}  // namespace tessera

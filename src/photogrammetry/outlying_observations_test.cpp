#include "photogrammetry/outlying_observations.h"

#include <gtest/gtest.h>

#include <set>

#include "base/random.h"

namespace tessera {
namespace {

constexpr int kPhotos = 8;
constexpr uint64_t kPoints = 2000;

// Points below a line of photos that look straight down, a metre apart, seen with errors of up to `noise` pixels in
// each direction, in the last photo of up to `noiseOfLast`. Of every 20th point, the third photo has a wrong match.
class SurveyModel {
 public:
  SurveyModel(double noise, double noiseOfLast) {
    Camera camera;
    camera.width = 800;
    camera.height = 600;
    camera.parameters = {700, 700, 400, 300};
    model.cameras[1] = camera;
    const RandomStream random(1, 2);
    uint64_t drawn = 0;
    const auto within = [&](double most) { return most * (2 * random.uniformDouble(drawn++) - 1); };
    for (uint64_t i = 0; i < kPoints; ++i) {
      ColmapModel::Point point;
      point.id = i + 1;
      point.point.xInWorld = {3 + within(4), within(3), 20 + within(2)};
      model.points.push_back(point);
    }
    for (int photo = 0; photo < kPhotos; ++photo) {
      ColmapModel::Image image;
      image.id = static_cast<uint32_t>(photo + 1);
      image.camera = 1;
      image.quaternion = {1, 0, 0, 0};
      image.translation = {-1.0 * photo, 0, 0};
      const double error = photo == kPhotos - 1 ? noiseOfLast : noise;
      for (const ColmapModel::Point& point : model.points) {
        const auto pixel = camera.pixelFromCamera(point.point.xInWorld - Vec3d(photo, 0, 0));
        const bool isWrong = photo == 2 && point.id % 20 == 0;
        image.keypoints.push_back(
            {pixel->x() + within(error) + (isWrong ? 3 : 0), pixel->y() + within(error), point.id});
      }
      model.images.push_back(image);
    }
  }
  ColmapModel model;
};

TEST(OutlyingObservations, AreThoseOfWrongMatches) {
  ColmapModel model = SurveyModel(0.3, 0.3).model;
  EXPECT_EQ(removeOutlyingObservations(model), kPoints / 20);
  EXPECT_EQ(model.points.size(), kPoints) << "others show them";
  for (const ColmapModel::Keypoint& keypoint : model.images[2].keypoints) EXPECT_NE(keypoint.point % 20, 0u);
  EXPECT_EQ(model.images[3].keypoints.size(), kPoints);
}

// A photo that is out of place must keep what would correct it.
TEST(OutlyingObservations, AreJudgedByTheOthersOfTheirPhoto) {
  ColmapModel model = SurveyModel(0.3, 6).model;
  removeOutlyingObservations(model);
  EXPECT_EQ(model.images.back().keypoints.size(), kPoints);
  EXPECT_EQ(model.images[2].keypoints.size(), kPoints - kPoints / 20);
}

TEST(OutlyingObservations, AreKeptByAPhotoWithFewOthers) {
  ColmapModel model = SurveyModel(0.3, 0.3).model;
  model.images[2].keypoints.resize(29);  // the wrong match of point 20 among them
  EXPECT_EQ(removeOutlyingObservations(model), 0u);
}

// As at the end of a line: most points are those of two photos, of which one is blurred.
TEST(OutlyingObservations, LeaveThePhotosOfABlurredOneWhatItNeeds) {
  ColmapModel model = SurveyModel(0.3, 0.3).model;
  ColmapModel::Image &sharp = model.images[6], &blurred = model.images[7];
  for (size_t k = 0; k < kPoints; ++k) {
    if (k < 100) {
      // Triangulation has shared its error with the sharp photo.
      sharp.keypoints[k].x += 3;
      blurred.keypoints[k].x -= 3;
    }
  }
  blurred.keypoints.resize(100);
  for (ColmapModel::Image& image : model.images)
    if (image.id <= 6) image.keypoints.erase(image.keypoints.begin(), image.keypoints.begin() + 100);
  removeOutlyingObservations(model);
  EXPECT_EQ(blurred.keypoints.size(), 100u);
  EXPECT_EQ(sharp.keypoints.size(), kPoints);
}

TEST(OutlyingObservations, TakePointsWithThemThatOnePhotoIsLeftToShow) {
  ColmapModel model = SurveyModel(0.3, 0.3).model;
  for (ColmapModel::Image& image : model.images)
    if (image.id > 3) std::erase_if(image.keypoints, [](const auto& keypoint) { return keypoint.point % 40 == 0; });
  model.images[0].keypoints.erase(model.images[0].keypoints.begin() + 39);  // point 40 is left to two photos
  removeOutlyingObservations(model);
  std::set<uint64_t> points;
  for (const ColmapModel::Point& point : model.points) points.insert(point.id);
  EXPECT_FALSE(points.contains(40));
  EXPECT_TRUE(points.contains(80));
  for (const ColmapModel::Image& image : model.images)
    for (const ColmapModel::Keypoint& keypoint : image.keypoints) EXPECT_TRUE(points.contains(keypoint.point));
}

TEST(OutlyingObservations, IncludePointsThatCannotBeSeen) {
  ColmapModel model = SurveyModel(0.3, 0.3).model;
  model.points[4].point.xInWorld.z() = -20;
  model.points[5].point.xInWorld.x() = std::numeric_limits<double>::quiet_NaN();
  removeOutlyingObservations(model);
  for (const ColmapModel::Point& point : model.points) EXPECT_TRUE(point.id != 5 && point.id != 6);
}

TEST(OutlyingObservations, AreNoneOfAModelWithoutObservations) {
  ColmapModel model;
  EXPECT_EQ(removeOutlyingObservations(model), 0u);
  model = SurveyModel(0.3, 0.3).model;
  model.cameras.clear();
  EXPECT_EQ(removeOutlyingObservations(model), 0u);
}

}  // namespace
}  // namespace tessera

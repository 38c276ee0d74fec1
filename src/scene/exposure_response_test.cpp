#include "scene/exposure_response.h"

#include <gtest/gtest.h>

#include <cmath>

#include "base/random.h"
#include "scene/capture.h"

namespace tessera {
namespace {

// Photos whose exposures differ by about half a stop; every eighth is held out.
Capture photos(int count) {
  Capture capture;
  const RandomStream random(5, 2);
  for (int i = 0; i < count; ++i) {
    Photo photo;
    photo.exposure = 2 * random.uniformDouble(static_cast<uint64_t>(i)) - 1;
    photo.split = i % 8 == 0 ? Split::test : Split::train;
    capture.photos.push_back(photo);
  }
  return capture;
}

std::vector<float> gains(const Capture& capture, double slope, double noise) {
  std::vector<float> logGains;
  const RandomStream random(6, 2);
  for (size_t i = 0; i < capture.photos.size(); ++i) {
    for (size_t c = 0; c < 3; ++c) {
      const double error = noise * (2 * random.uniformDouble(3 * i + c) - 1);
      // Held-out photos have none.
      const bool isTrained = capture.photos[i].split == Split::train;
      logGains.push_back(
          isTrained
              ? static_cast<float>((slope + 0.1 * static_cast<double>(c)) * *capture.photos[i].exposure + 0.2 + error)
              : 0.0f);
    }
  }
  return logGains;
}

std::optional<ExposureResponse> fit(const Capture& capture, const std::vector<float>& logGains) {
  std::vector<std::optional<double>> exposures;
  for (const Photo& photo : capture.photos) exposures.push_back(photo.exposure);
  return fitExposureResponse(exposures, capture.photosIn(Split::train), logGains);
}

TEST(ExposureResponse, IsTheLineThroughTheGainsOfTrainedPhotos) {
  const Capture capture = photos(40);
  const auto response = fit(capture, gains(capture, 0.45, 0));
  ASSERT_TRUE(response.has_value());
  for (size_t c = 0; c < 3; ++c) {
    EXPECT_NEAR(response->slope[c], 0.45 + 0.1 * static_cast<double>(c), 1e-5);
    EXPECT_NEAR(response->offset[c], 0.2, 1e-5);
  }
  EXPECT_NEAR(response->gain(1)[0], std::exp2(0.65), 1e-5);
  EXPECT_NEAR(response->gain(0)[0], std::exp2(0.2), 1e-5);
  EXPECT_EQ(response->gain(std::nullopt), (std::array<double, 3>{1, 1, 1}));
}

TEST(ExposureResponse, IsUsedOnlyIfItExplainsMostOfTheGains) {
  const Capture capture = photos(40);
  EXPECT_TRUE(fit(capture, gains(capture, 0.45, 0.2)).has_value());
  EXPECT_FALSE(fit(capture, gains(capture, 0.45, 3)).has_value());
  EXPECT_FALSE(fit(capture, std::vector<float>(120, 0.0f)).has_value());
}

TEST(ExposureResponse, HasASlopeThatLightHas) {
  const Capture capture = photos(40);
  EXPECT_TRUE(fit(capture, gains(capture, 1.5, 0)).has_value());
  EXPECT_FALSE(fit(capture, gains(capture, 2.5, 0)).has_value());
  EXPECT_FALSE(fit(capture, gains(capture, -1, 0)).has_value()) << "photos that collected more light are darker";
}

TEST(ExposureResponse, NeedsPhotosWhoseExposuresAreKnownAndDiffer) {
  const Capture few = photos(8);
  EXPECT_FALSE(fit(few, gains(few, 0.45, 0)).has_value()) << "seven are trained on";
  Capture same = photos(40);
  const std::vector<float> logGains = gains(same, 0.45, 0);
  for (Photo& photo : same.photos) photo.exposure = 0.01;
  EXPECT_FALSE(fit(same, logGains).has_value());
  for (Photo& photo : same.photos) photo.exposure.reset();
  EXPECT_FALSE(fit(same, logGains).has_value());
}

}  // namespace
}  // namespace tessera

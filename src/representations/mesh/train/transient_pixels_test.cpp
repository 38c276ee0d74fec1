#include "representations/mesh/train/transient_pixels.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>

namespace tessera {
namespace {

constexpr int kWidth = 40, kHeight = 30, kPhotos = 8;
constexpr float kPixel = 0.01f;  // on the plane, scene units

using Shade = std::function<float(int photo, int x, int y, float texture)>;

float textureAt(float u, float v) {
  return 0.5f + 0.2f * std::sin(40 * u) * std::cos(30 * v);
}

// Returns photos of a textured plane, each two pixels beside the last one; the field shows the plane's mean colour.
std::vector<ComparedPhoto> photographPlane(int count, const Shade& shade) {
  std::vector<ComparedPhoto> photos;
  for (int photo = 0; photo < count; ++photo) {
    ImageF colours(kWidth, kHeight, 3), field(kWidth, kHeight, 3, 0.5f), points(kWidth, kHeight, 3);
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        const float u = kPixel * (static_cast<float>(x + 2 * photo) + 0.5f),
                    v = kPixel * (static_cast<float>(y) + 0.5f);
        const float colour = shade(photo, x, y, textureAt(u, v));
        for (int k = 0; k < 3; ++k) colours.at(x, y)[k] = colour;
        points.at(x, y)[0] = u;
        points.at(x, y)[1] = v;
      }
    }
    photos.push_back({subtractField(colours, field, points), points});
  }
  return photos;
}

TransientSettings planeSettings() {
  TransientSettings settings;
  settings.voxel = 2 * kPixel;
  return settings;
}

// A patch of another colour in photo 3, [left, right) × [top, bottom).
constexpr int kLeft = 14, kRight = 23, kTop = 10, kBottom = 18, kMoved = 3;
float withPatch(int photo, int x, int y, float texture) {
  const bool isPatch = photo == kMoved && x >= kLeft && x < kRight && y >= kTop && y < kBottom;
  return isPatch ? texture - 0.3f : texture;
}

size_t countExcluded(const std::vector<ImageU8>& masks) {
  size_t sum = 0;
  for (const ImageU8& mask : masks)
    sum += static_cast<size_t>(std::count(mask.pixels.begin(), mask.pixels.end(), uint8_t{0}));
  return sum;
}

TEST(TransientPixels, AreThoseOfAPatchThatOnePhotoShows) {
  const std::vector<ImageU8> masks = findTransientPixels(photographPlane(kPhotos, withPatch), planeSettings());
  ASSERT_EQ(masks.size(), size_t{kPhotos});
  constexpr int kMargin = 2;  // the mean of 3×3 pixels, and the dilation
  for (int photo = 0; photo < kPhotos; ++photo) {
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        const auto isIn = [&](int margin) {
          return photo == kMoved && x >= kLeft - margin && x < kRight + margin && y >= kTop - margin &&
                 y < kBottom + margin;
        };
        if (isIn(0)) {
          EXPECT_EQ(*masks[static_cast<size_t>(photo)].at(x, y), 0) << x << ' ' << y;
        } else if (!isIn(kMargin)) {
          EXPECT_EQ(*masks[static_cast<size_t>(photo)].at(x, y), 255) << photo << ": " << x << ' ' << y;
        }
      }
    }
  }
}

TEST(TransientPixels, AreNotThoseOfPhotosWithOtherExposures) {
  const auto exposed = [](int photo, int, int, float texture) {
    return texture * std::exp2(0.25f * static_cast<float>(photo - kPhotos / 2));
  };
  EXPECT_EQ(countExcluded(findTransientPixels(photographPlane(kPhotos, exposed), planeSettings())), 0u);
}

TEST(TransientPixels, AreNotThoseThatTheFieldAloneShowsOtherwise) {
  // Stripes, fixed to the plane, that the field does not show.
  const auto striped = [](int photo, int x, int, float texture) {
    return (x + 2 * photo) / 8 % 2 == 0 ? texture + 0.2f : texture - 0.2f;
  };
  EXPECT_EQ(countExcluded(findTransientPixels(photographPlane(kPhotos, striped), planeSettings())), 0u);
}

TEST(TransientPixels, AreNotThoseThatTooFewPhotosShow) {
  TransientSettings settings = planeSettings();
  settings.leastPhotos = kPhotos + 1;
  EXPECT_EQ(countExcluded(findTransientPixels(photographPlane(kPhotos, withPatch), settings)), 0u);
}

TEST(TransientPixels, AreNotThoseWithoutASurface) {
  std::vector<ComparedPhoto> photos = photographPlane(kPhotos, withPatch);
  std::fill(photos[kMoved].points.pixels.begin(), photos[kMoved].points.pixels.end(),
            std::numeric_limits<float>::quiet_NaN());
  EXPECT_EQ(countExcluded(findTransientPixels(std::move(photos), planeSettings())), 0u);
}

}  // namespace
}  // namespace tessera

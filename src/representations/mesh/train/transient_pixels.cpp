#include "representations/mesh/train/transient_pixels.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <compare>
#include <limits>
#include <optional>
#include <span>

#include "base/check.h"
#include "base/order_statistics.h"
#include "base/random.h"

namespace tessera {
namespace {

constexpr size_t kChannels = 3;
using Colour = std::array<float, kChannels>;

float meanMagnitude(const Colour& colour) {
  float sum = 0;
  for (const float channel : colour) sum += std::abs(channel);
  return sum / kChannels;
}

// A pixel of a photo, and the voxel that it shows.
struct PlacedPixel {
  uint64_t voxel = 0;
  uint32_t photo = 0, pixel = 0;

  auto operator<=>(const PlacedPixel&) const = default;
};

std::optional<uint64_t> findVoxel(const float* point, double edge) {
  constexpr int kBits = 19, kHalf = 1 << (kBits - 1);
  if (std::isnan(point[0])) return std::nullopt;
  const double farthest = std::max({std::abs(point[0]), std::abs(point[1]), std::abs(point[2])});
  const int octave = farthest > 1 ? std::ilogb(farthest) + 1 : 0;
  uint64_t voxel = static_cast<uint64_t>(octave);
  for (int axis = 0; axis < 3; ++axis) {
    const double place = std::floor(std::ldexp(point[axis] / edge, -octave)) + kHalf;
    if (!(place >= 0 && place < 2 * kHalf)) return std::nullopt;
    voxel = voxel << kBits | static_cast<uint64_t>(place);
  }
  return voxel;
}

class PhotoComparison {
 public:
  PhotoComparison(std::vector<ComparedPhoto> photos, const TransientSettings& settings)
      : photos_(std::move(photos)), settings_(settings) {
    for (const ComparedPhoto& photo : photos_) limits_.emplace_back(photo.points.width, photo.points.height, 1);
    // The voxels are compared in groups, which limits the memory.
    constexpr uint64_t kGroups = 16;
    for (uint64_t group = 0; group < kGroups; ++group) {
      const std::vector<PlacedPixel> placed = placePixels(group, kGroups);
      for (size_t first = 0, next = 0; first < placed.size(); first = next) {
        while (next < placed.size() && placed[next].voxel == placed[first].voxel) ++next;
        compareVoxel(std::span(placed).subspan(first, next - first));
      }
    }
  }

  // Returns by how much each pixel of a photo, averaged with those around it, deviates relative to the limit.
  ImageF deviations(size_t photo) const;

 private:
  std::vector<PlacedPixel> placePixels(uint64_t group, uint64_t groups) const {
    std::vector<PlacedPixel> placed;
    for (uint32_t photo = 0; photo < photos_.size(); ++photo) {
      const ImageF& points = photos_[photo].points;
      for (uint32_t pixel = 0; pixel < points.pixelCount(); ++pixel) {
        const auto voxel = findVoxel(&points.pixels[kChannels * pixel], settings_.voxel);
        if (voxel && mix64(*voxel) % groups == group) placed.push_back({*voxel, photo, pixel});
      }
    }
    std::sort(placed.begin(), placed.end());
    return placed;
  }
  float* difference(const PlacedPixel& at) { return &photos_[at.photo].difference.pixels[kChannels * at.pixel]; }
  void compareVoxel(std::span<const PlacedPixel> pixels);

  std::vector<ComparedPhoto> photos_;  // compareVoxel subtracts the medians from the differences
  std::vector<ImageF> limits_;         // [photo], of usual deviations; 0: too few photos show the place
  TransientSettings settings_;
};

// `pixels` are in the order of photos.
void PhotoComparison::compareVoxel(std::span<const PlacedPixel> pixels) {
  std::vector<Colour> means;
  for (size_t first = 0, next = 0; first < pixels.size(); first = next) {
    Colour mean{};
    for (; next < pixels.size() && pixels[next].photo == pixels[first].photo; ++next)
      for (size_t k = 0; k < kChannels; ++k) mean[k] += difference(pixels[next])[k];
    for (float& channel : mean) channel /= static_cast<float>(next - first);
    means.push_back(mean);
  }
  if (means.size() < settings_.leastPhotos) return;
  Colour median;
  std::vector<float> values(means.size());
  for (size_t k = 0; k < kChannels; ++k) {
    std::transform(means.begin(), means.end(), values.begin(), [&](const Colour& mean) { return mean[k]; });
    median[k] = upperMedian(values);
  }
  std::transform(means.begin(), means.end(), values.begin(), [&](Colour deviation) {
    for (size_t k = 0; k < kChannels; ++k) deviation[k] -= median[k];
    return meanMagnitude(deviation);
  });
  const float limit = std::max(settings_.leastDeviation, settings_.spreads * upperMedian(values));
  for (const PlacedPixel& at : pixels) {
    limits_[at.photo].pixels[at.pixel] = limit;
    for (size_t k = 0; k < kChannels; ++k) difference(at)[k] -= median[k];
  }
}

// Calls `visit(x, y)` for the 3×3 pixels around one, as far as they are in the image.
template <class T, class Visit>
void visitAround(const Image<T>& image, int x, int y, const Visit& visit) {
  for (int v = std::max(0, y - 1); v <= std::min(image.height - 1, y + 1); ++v)
    for (int u = std::max(0, x - 1); u <= std::min(image.width - 1, x + 1); ++u) visit(u, v);
}

ImageF PhotoComparison::deviations(size_t photo) const {
  const ImageF& limits = limits_[photo];
  ImageF relative(limits.width, limits.height, 1);
  for (int y = 0; y < limits.height; ++y) {
    for (int x = 0; x < limits.width; ++x) {
      if (*limits.at(x, y) == 0) continue;
      Colour sum{};
      float sumOfLimits = 0;
      visitAround(limits, x, y, [&](int u, int v) {
        if (*limits.at(u, v) == 0) return;
        for (size_t k = 0; k < kChannels; ++k) sum[k] += photos_[photo].difference.at(u, v)[k];
        sumOfLimits += *limits.at(u, v);
      });
      *relative.at(x, y) = meanMagnitude(sum) / sumOfLimits;
    }
  }
  return relative;
}

ImageU8 maskDeviations(const ImageF& deviations) {
  ImageU8 mask(deviations.width, deviations.height, 1, 255);
  ImageU8 isTransient(deviations.width, deviations.height, 1);
  std::vector<std::array<int, 2>> border;
  const auto add = [&](int x, int y) {
    if (*isTransient.at(x, y) != 0) return;
    *isTransient.at(x, y) = 1;
    border.push_back({x, y});
    visitAround(mask, x, y, [&](int u, int v) { *mask.at(u, v) = 0; });
  };
  for (int y = 0; y < deviations.height; ++y) {
    for (int x = 0; x < deviations.width; ++x) {
      int deviate = 0, all = 0;
      visitAround(deviations, x, y, [&](int u, int v) {
        deviate += *deviations.at(u, v) > 1 ? 1 : 0;
        ++all;
      });
      if (2 * deviate > all) add(x, y);
    }
  }
  while (!border.empty()) {
    const auto [x, y] = border.back();
    border.pop_back();
    visitAround(deviations, x, y, [&](int u, int v) {
      if (*deviations.at(u, v) > 1) add(u, v);
    });
  }
  return mask;
}

}  // namespace

ImageF subtractField(const ImageF& photo, const ImageF& field, const ImageF& points) {
  constexpr float kDark = 0.05f;  // quotients of darker colours are noise
  CHECK(photo.pixels.size() == points.pixels.size());
  CHECK(field.pixels.size() == points.pixels.size());
  ImageF difference(photo.width, photo.height, kChannels);
  for (size_t channel = 0; channel < kChannels; ++channel) {
    std::vector<float> quotients;
    for (size_t i = channel; i < field.pixels.size(); i += kChannels)
      if (!std::isnan(points.pixels[i]) && field.pixels[i] > kDark)
        quotients.push_back(photo.pixels[i] / field.pixels[i]);
    const float gain = quotients.empty() ? 1 : std::max(kDark, upperMedian(quotients));
    for (size_t i = channel; i < field.pixels.size(); i += kChannels)
      difference.pixels[i] = photo.pixels[i] / gain - field.pixels[i];
  }
  return difference;
}

std::vector<ImageU8> findTransientPixels(std::vector<ComparedPhoto> photos, const TransientSettings& settings) {
  const size_t count = photos.size();
  const PhotoComparison comparison(std::move(photos), settings);
  std::vector<ImageU8> masks;
  for (size_t photo = 0; photo < count; ++photo) masks.push_back(maskDeviations(comparison.deviations(photo)));
  return masks;
}

}  // namespace tessera

#include "base/image.h"

#include <algorithm>
#include <cmath>

#include "base/check.h"

namespace tessera {
namespace {

// Which source cells one target cell covers, and how much of each.
struct Coverage {
  int first = 0;
  std::vector<float> weights;  // sum to 1
};

std::vector<Coverage> computeCoverage(int source, int target) {
  std::vector<Coverage> all(static_cast<size_t>(target));
  for (int64_t i = 0; i < target; ++i) {
    // In units of 1/target source cells everything is an integer, so the weights are exact for any ratio.
    const int64_t begin = i * source, end = (i + 1) * source;
    Coverage& one = all[static_cast<size_t>(i)];
    one.first = static_cast<int>(begin / target);
    for (int64_t cell = one.first; cell * target < end; ++cell) {
      const int64_t covered = std::min(end, (cell + 1) * target) - std::max(begin, cell * target);
      one.weights.push_back(static_cast<float>(static_cast<double>(covered) / source));
    }
  }
  return all;
}

template <class T>
T finished(float sum) {
  if constexpr (std::is_same_v<T, uint8_t>) {
    return static_cast<uint8_t>(std::clamp(sum + 0.5f, 0.0f, 255.0f));
  } else {
    return sum;
  }
}

template <class T>
Image<T> downscale(const Image<T>& image, int width, int height) {
  CHECK(width >= 1);
  CHECK(height >= 1);
  CHECK(width <= image.width);
  CHECK(height <= image.height);
  if (width == image.width && height == image.height) return image;
  const std::vector<Coverage> columns = computeCoverage(image.width, width),
                              rows = computeCoverage(image.height, height);
  const int channels = image.channels;
  Image<T> result(width, height, channels);
  std::vector<float> line(static_cast<size_t>(image.width) * channels);  // the source rows of one target row, averaged
  for (int y = 0; y < height; ++y) {
    std::fill(line.begin(), line.end(), 0.0f);
    for (size_t j = 0; j < rows[y].weights.size(); ++j) {
      const T* source = image.at(0, rows[y].first + static_cast<int>(j));
      const float weight = rows[y].weights[j];
      for (size_t k = 0; k < line.size(); ++k) line[k] += weight * static_cast<float>(source[k]);
    }
    T* target = result.at(0, y);
    for (int x = 0; x < width; ++x) {
      const float* source = line.data() + static_cast<size_t>(columns[x].first) * channels;
      for (int c = 0; c < channels; ++c) {
        float sum = 0;
        for (size_t i = 0; i < columns[x].weights.size(); ++i) sum += columns[x].weights[i] * source[i * channels + c];
        *target++ = finished<T>(sum);
      }
    }
  }
  return result;
}

}  // namespace

ImageF toFloat(const ImageU8& image) {
  ImageF result(image.width, image.height, image.channels);
  std::transform(image.pixels.begin(), image.pixels.end(), result.pixels.begin(),
                 [](uint8_t value) { return static_cast<float>(value) / 255.0f; });
  return result;
}

ImageU8 toBytes(const ImageF& image) {
  ImageU8 result(image.width, image.height, image.channels);
  std::transform(image.pixels.begin(), image.pixels.end(), result.pixels.begin(), [](float value) {
    // The comparison is false for NaN, which becomes black.
    return value > 0.0f ? static_cast<uint8_t>(std::min(value, 1.0f) * 255.0f + 0.5f) : uint8_t{0};
  });
  return result;
}

ImageU8 downscaleByArea(const ImageU8& image, int width, int height) {
  return downscale(image, width, height);
}
ImageF downscaleByArea(const ImageF& image, int width, int height) {
  return downscale(image, width, height);
}

ImageU8 turnUpright(const ImageU8& image, int orientation) {
  if (orientation <= 1 || orientation > 8) return image;
  const bool isTransposed = orientation >= 5;
  const bool fromRight = orientation == 2 || orientation == 3 || orientation == 7 || orientation == 8;
  const bool fromBottom = orientation == 3 || orientation == 4 || orientation == 6 || orientation == 7;
  ImageU8 upright(isTransposed ? image.height : image.width, isTransposed ? image.width : image.height, image.channels);
  for (int y = 0; y < upright.height; ++y) {
    for (int x = 0; x < upright.width; ++x) {
      const int column = isTransposed ? y : x, row = isTransposed ? x : y;
      std::copy_n(image.at(fromRight ? image.width - 1 - column : column, fromBottom ? image.height - 1 - row : row),
                  image.channels, upright.at(x, y));
    }
  }
  return upright;
}

}  // namespace tessera

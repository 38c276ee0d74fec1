#include "photogrammetry/frame_choice.h"

#include <algorithm>
#include <limits>
#include <numeric>

#include "base/check.h"

namespace tessera {
namespace {

constexpr int kFewestFrames = 3;  // without which there are no poses

}  // namespace

double imageSharpness(const ImageU8& grey) {
  CHECK(grey.channels == 1);
  if (grey.width < 3 || grey.height < 3) return 0;
  int64_t sum = 0, squares = 0, brightness = 0;
  for (int y = 1; y + 1 < grey.height; ++y) {
    const uint8_t *above = grey.at(0, y - 1), *row = grey.at(0, y), *below = grey.at(0, y + 1);
    int rowSum = 0, rowBrightness = 0;
    int64_t rowSquares = 0;
    for (int x = 1; x + 1 < grey.width; ++x) {
      const int laplacian = 4 * row[x] - row[x - 1] - row[x + 1] - above[x] - below[x];
      rowSum += laplacian;
      rowSquares += laplacian * laplacian;
      rowBrightness += row[x];
    }
    sum += rowSum;
    squares += rowSquares;
    brightness += rowBrightness;
  }
  const double count = static_cast<double>(grey.width - 2) * (grey.height - 2);
  const double mean = static_cast<double>(sum) / count;
  // Noise of pictures that are nearly black would count as sharp.
  constexpr double kDark = 8;
  const double level = static_cast<double>(brightness) / count + kDark;
  return std::max(0.0, static_cast<double>(squares) / count - mean * mean) / (level * level);
}

std::vector<size_t> chooseFrames(std::span<const double> times, std::span<const double> sharpness, int count) {
  CHECK(times.size() == sharpness.size());
  const size_t frames = times.size();
  std::vector<size_t> chosen;
  const auto chooseAll = [&] {
    chosen.resize(frames);
    std::iota(chosen.begin(), chosen.end(), size_t{0});
    return chosen;
  };
  if (frames < 2) return chooseAll();
  // A step back, as of a damaged file, is none.
  std::vector<double> ordered(times.begin(), times.end());
  std::partial_sum(ordered.begin(), ordered.end(), ordered.begin(), [](double a, double b) { return std::max(a, b); });
  if (ordered.back() <= ordered.front()) std::iota(ordered.begin(), ordered.end(), 0.0);
  const double span = ordered.back() - ordered.front();
  const double duration = span + span / static_cast<double>(frames - 1);  // the last frame is shown for a while, too
  if (count <= 0) {
    count =
        static_cast<int>(std::clamp(duration / kShortestInterval, double{kFewestFrames}, double{kMaxDefaultFrames}));
  }
  if (frames <= static_cast<size_t>(count)) return chooseAll();
  const double interval = duration / count;
  size_t at = 0;
  double earliest = -std::numeric_limits<double>::infinity();
  for (int k = 0; k < count; ++k) {
    const double end = k + 1 == count ? std::numeric_limits<double>::infinity() : ordered.front() + (k + 1) * interval;
    size_t best = frames;
    for (; at < frames && ordered[at] < end; ++at)
      if (ordered[at] >= earliest && (best == frames || sharpness[at] > sharpness[best])) best = at;
    if (best == frames) continue;
    chosen.push_back(best);
    earliest = ordered[best] + interval / 2;
  }
  return chosen;
}

}  // namespace tessera

#include "tiles/occupancy_distance.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <utility>

namespace tessera {
namespace {

constexpr uint32_t kNone = 0xffffffffu;  // no occupied cell in this row, plane or grid

// min over q of values[q] + (p - q)², for every p of a line: the lower envelope of parabolas.
class Envelope {
 public:
  explicit Envelope(size_t length) : apex_(length), from_(length + 1), value_(length) {}

  // `stride` apart, in place.
  void run(uint32_t* line, size_t length, size_t stride) {
    size_t count = 0;
    for (size_t q = 0; q < length; ++q) {
      value_[q] = line[q * stride];
      if (value_[q] == kNone) continue;
      while (count > 0) {
        const double meets = meeting(apex_[count - 1], q);
        if (meets > from_[count - 1]) {
          from_[count] = meets;
          break;
        }
        --count;
      }
      if (count == 0) from_[0] = -1;
      apex_[count++] = q;
    }
    if (count == 0) return;
    size_t lowest = 0;
    for (size_t p = 0; p < length; ++p) {
      while (lowest + 1 < count && from_[lowest + 1] < static_cast<double>(p)) ++lowest;
      const size_t q = apex_[lowest], apart = p > q ? p - q : q - p;
      line[p * stride] = static_cast<uint32_t>(value_[q] + apart * apart);
    }
  }

 private:
  // Where the parabola of a later q becomes the lower one.
  double meeting(size_t before, size_t q) const {
    const auto height = [&](size_t i) { return static_cast<double>(value_[i]) + static_cast<double>(i * i); };
    return (height(q) - height(before)) / (2 * static_cast<double>(q - before));
  }

  std::vector<size_t> apex_;
  std::vector<double> from_;  // the first place where it is the lowest
  std::vector<uint32_t> value_;
};

}  // namespace

std::vector<uint8_t> naiveOccupancyDistances(const OccupancyBits& occupied) {
  const size_t n = occupied.cells;
  std::vector<uint32_t> squares(occupied.count(), kNone);
  for (size_t i = 0; i < squares.size(); ++i) {
    if (occupied.at(i)) squares[i] = 0;
  }
  Envelope envelope(n);
  for (size_t j = 0; j < n * n; ++j) envelope.run(&squares[j * n], n, 1);
  for (size_t z = 0; z < n; ++z) {
    for (size_t x = 0; x < n; ++x) envelope.run(&squares[x + n * n * z], n, n);
  }
  for (size_t i = 0; i < n * n; ++i) envelope.run(&squares[i], n, n * n);
  std::vector<uint8_t> distances(squares.size());
  for (size_t i = 0; i < distances.size(); ++i) {
    // Roots of whole numbers this small are exact where they are whole.
    const double root = squares[i] == kNone ? kFarthestDistance : std::sqrt(static_cast<double>(squares[i]));
    distances[i] = static_cast<uint8_t>(std::min<double>(root, kFarthestDistance));
  }
  return distances;
}

OccupancyBits dilated(const OccupancyBits& occupied) {
  const uint32_t n = occupied.cells;
  OccupancyBits grown(n);
  const auto around = [&](uint32_t i) { return std::pair{i > 0 ? i - 1 : 0, std::min(i + 1, n - 1)}; };
  for (size_t word = 0; word < occupied.words.size(); ++word) {
    for (uint64_t bits = occupied.words[word]; bits != 0; bits &= bits - 1) {
      const size_t number = 64 * word + static_cast<size_t>(std::countr_zero(bits));
      const uint32_t x = static_cast<uint32_t>(number % n), y = static_cast<uint32_t>(number / n % n),
                     z = static_cast<uint32_t>(number / n / n);
      for (uint32_t k = around(z).first; k <= around(z).second; ++k) {
        for (uint32_t j = around(y).first; j <= around(y).second; ++j) {
          for (uint32_t i = around(x).first; i <= around(x).second; ++i) grown.set(grown.number(i, j, k));
        }
      }
    }
  }
  return grown;
}

std::vector<uint8_t> occupancyDistances(const OccupancyBits& occupied) {
  return naiveOccupancyDistances(dilated(occupied));
}

}  // namespace tessera

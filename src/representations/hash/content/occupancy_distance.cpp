#include "representations/hash/content/occupancy_distance.h"

#include <algorithm>
#include <array>
#include <bit>
#include <utility>

namespace tessera {

std::vector<uint32_t> octantDistances(const OccupancyBits& occupied) {
  const size_t n = occupied.cells;
  std::vector<uint32_t> distances(occupied.count(), 0);
  for (uint32_t octant = 0; octant < 8; ++octant) {
    const uint32_t shift = 4 * octant;
    // A sweep begins with the cells at the end towards which the octant points.
    const auto ordered = [n](size_t i, bool up) { return up ? n - 1 - i : i; };
    const bool up[3] = {(octant & 1) != 0, (octant & 2) != 0, (octant & 4) != 0};
    for (size_t k = 0; k < n; ++k) {
      for (size_t j = 0; j < n; ++j) {
        const size_t row = n * (ordered(j, up[1]) + n * ordered(k, up[2]));
        // Offsets to the rows that are next along y and z.
        const ptrdiff_t y = up[1] ? static_cast<ptrdiff_t>(n) : -static_cast<ptrdiff_t>(n);
        const ptrdiff_t z = up[2] ? static_cast<ptrdiff_t>(n * n) : -static_cast<ptrdiff_t>(n * n);
        // The minimum over the three rows next to this one, at the given cell's position in x.
        const auto beside = [&](size_t cell) {
          uint32_t minimum = kFarthestOctantDistance;
          const auto look = [&](ptrdiff_t offset) {
            const size_t number = static_cast<size_t>(static_cast<ptrdiff_t>(cell) + offset);
            minimum = std::min(minimum, distances[number] >> shift & 15);
          };
          if (j > 0) look(y);
          if (k > 0) look(z);
          if (j > 0 && k > 0) look(y + z);
          return minimum;
        };
        uint32_t next = kFarthestOctantDistance;  // the minimum over the four cells one step further along x
        for (size_t i = 0; i < n; ++i) {
          const size_t cell = row + ordered(i, up[0]);
          const uint32_t here = beside(cell);
          const uint32_t free = occupied.at(cell) ? 0 : std::min(kFarthestOctantDistance, 1 + std::min(here, next));
          distances[cell] |= free << shift;
          next = std::min(here, free);
        }
      }
    }
  }
  return distances;
}

uint32_t OctantDistanceField::ratioFor(uint32_t finestCells) {
  uint32_t ratio = 1;
  while (ratio < kMaxRatio && finestCells / ratio > kMaxCoarse) ratio *= 2;
  return ratio;
}

namespace {

const OccupancyBits& coarseLevel(const OccupancyPyramid& occupied) {
  const uint32_t ratio = OctantDistanceField::ratioFor(occupied.levels.front().cells);
  return occupied.levels[static_cast<size_t>(std::countr_zero(ratio))];
}

// Computes the distances of one octant for the finest cells of all near cells. A finest cell in an empty coarse cell,
// whose distance is k coarse cells, takes the part of this distance that remains from its own position.
class NearSweep {
 public:
  // `full`: by index of near cell, whether all of its finest cells are occupied.
  NearSweep(const OccupancyBits& finest, const std::vector<bool>& full, OctantDistanceField& into, uint32_t octant)
      : finest_(finest), full_(full), into_(into), octant_(octant), ratio_(into.ratio) {
    for (uint32_t a = 0; a < 3; ++a) up_[a] = (octant >> a & 1) != 0;
  }

  // Sweeps the grid from the end towards which the octant points.
  void run() {
    const uint32_t n = into_.cells;
    const auto ordered = [n](uint32_t i, bool up) { return up ? n - 1 - i : i; };
    for (uint32_t k = 0; k < n; ++k) {
      for (uint32_t j = 0; j < n; ++j) {
        for (uint32_t i = 0; i < n; ++i) {
          const Place cell = {ordered(i, up_[0]), ordered(j, up_[1]), ordered(k, up_[2])};
          const uint32_t word = coarseWordAt(cell);
          if (!OctantDistanceField::isEmpty(word) && !full_[word >> 4]) sweep(cell, word >> 4);
        }
      }
    }
  }

 private:
  using Place = std::array<uint32_t, 3>;
  static constexpr uint32_t kSide = OctantDistanceField::kMaxRatio + 1;

  uint32_t coarseWordAt(const Place& cell) const {
    const size_t n = into_.cells;
    return into_.coarse[cell[0] + n * (cell[1] + n * cell[2])];
  }
  // Along each axis, the finest cells of a coarse cell are counted from the end towards which the octant points,
  // starting at 1; 0 is the adjacent finest cell in the next coarse cell.
  uint32_t inside(size_t axis, uint32_t i) const {
    if (i == 0) return up_[axis] ? 0 : ratio_ - 1;
    return up_[axis] ? ratio_ - i : i - 1;
  }
  size_t fineNumber(uint32_t number, const Place& at) const {
    const size_t r = ratio_;
    return number * r * r * r + inside(0, at[0]) + r * (inside(1, at[1]) + r * inside(2, at[2]));
  }
  uint32_t& cellValue(const Place& at) { return values_[at[0] + kSide * (at[1] + kSide * at[2])]; }

  void sweep(const Place& cell, uint32_t number) {
    for (uint32_t next = 1; next < 8; ++next) takeNext(cell, next);
    for (uint32_t k = 1; k <= ratio_; ++k) {
      for (uint32_t j = 1; j <= ratio_; ++j) {
        for (uint32_t i = 1; i <= ratio_; ++i) {
          uint32_t minimum = kFarthestOctantDistance - 1;
          for (uint32_t next = 1; next < 8; ++next) {
            minimum = std::min(minimum, cellValue({i - (next & 1), j - (next >> 1 & 1), k - (next >> 2)}));
          }
          const Place at = {i, j, k};
          Place finest;
          for (size_t a = 0; a < 3; ++a) finest[a] = ratio_ * cell[a] + inside(a, at[a]);
          const uint32_t free = finest_.at(finest[0], finest[1], finest[2]) ? 0 : 1 + minimum;
          cellValue(at) = free;
          into_.fine[fineNumber(number, at)] |= free << (4 * octant_);
        }
      }
    }
  }

  // Fills in the values that are needed from the next coarse cell along the axes whose bits are set.
  void takeNext(const Place& cell, uint32_t axes) {
    Place other = cell, first, last;
    bool outside = false;
    for (size_t a = 0; a < 3; ++a) {
      const bool moves = (axes >> a & 1) != 0;
      first[a] = moves ? 0 : 1;
      last[a] = moves ? 0 : ratio_;
      if (!moves) continue;
      outside = outside || (up_[a] ? cell[a] + 1 == into_.cells : cell[a] == 0);
      other[a] = up_[a] ? cell[a] + 1 : cell[a] - 1;
    }
    const uint32_t word = outside ? 0xffffffffu : coarseWordAt(other);
    const uint32_t reach = outside ? 2 * kFarthestOctantDistance : ratio_ * octantDistance(word, octant_);
    for (uint32_t k = first[2]; k <= last[2]; ++k) {
      for (uint32_t j = first[1]; j <= last[1]; ++j) {
        for (uint32_t i = first[0]; i <= last[0]; ++i) {
          const Place at = {i, j, k};
          if (!OctantDistanceField::isEmpty(word)) {
            cellValue(at) = octantDistance(into_.fine[fineNumber(word >> 4, at)], octant_);
            continue;
          }
          uint32_t offset = 0;  // in finest cells, from where the coarse cube begins
          for (size_t a = 0; a < 3; ++a) offset = std::max(offset, at[a] == 0 ? 0 : ratio_ - at[a]);
          cellValue(at) = std::min(kFarthestOctantDistance, reach - offset);
        }
      }
    }
  }

  const OccupancyBits& finest_;
  const std::vector<bool>& full_;
  OctantDistanceField& into_;
  uint32_t octant_, ratio_;
  bool up_[3];
  std::array<uint32_t, kSide * kSide * kSide> values_{};  // of one coarse cell and the adjacent finest cells
};

}  // namespace

namespace {

bool isFull(const OccupancyBits& finest, uint32_t ratio, uint32_t x, uint32_t y, uint32_t z) {
  for (uint32_t k = 0; k < ratio; ++k) {
    for (uint32_t j = 0; j < ratio; ++j) {
      for (uint32_t i = 0; i < ratio; ++i) {
        if (!finest.at(ratio * x + i, ratio * y + j, ratio * z + k)) return false;
      }
    }
  }
  return true;
}

}  // namespace

OctantDistanceField octantDistances(const OccupancyPyramid& occupied) {
  const OccupancyBits &finest = occupied.levels.front(), &coarse = coarseLevel(occupied);
  OctantDistanceField distances;
  distances.ratio = OctantDistanceField::ratioFor(finest.cells);
  distances.cells = coarse.cells;
  distances.coarse = octantDistances(coarse);
  if (distances.ratio == 1) return distances;
  std::vector<bool> full;
  const uint32_t n = distances.cells;
  for (uint32_t cell = 0; cell < distances.coarse.size(); ++cell) {
    uint32_t& word = distances.coarse[cell];
    if (word != 0) continue;
    word = static_cast<uint32_t>(full.size()) << 4;
    full.push_back(isFull(finest, distances.ratio, cell % n, cell / n % n, cell / n / n));
  }
  distances.fine.assign(full.size() * distances.ratio * distances.ratio * distances.ratio, 0);
  for (uint32_t octant = 0; octant < 8; ++octant) NearSweep(finest, full, distances, octant).run();
  return distances;
}

size_t countNearCells(const OccupancyPyramid& occupied) {
  if (OctantDistanceField::ratioFor(occupied.levels.front().cells) == 1) return 0;
  size_t count = 0;
  for (const uint64_t word : coarseLevel(occupied).words) count += static_cast<size_t>(std::popcount(word));
  return count;
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

}  // namespace tessera

#include "tiles/occupancy_distance.h"

#include <algorithm>
#include <bit>
#include <utility>

namespace tessera {

std::vector<uint32_t> octantDistances(const OccupancyBits& occupied) {
  const size_t n = occupied.cells;
  std::vector<uint32_t> distances(occupied.count(), 0);
  for (uint32_t octant = 0; octant < 8; ++octant) {
    const uint32_t shift = 4 * octant;
    // The first cells of a sweep are those at the far end.
    const auto ordered = [n](size_t i, bool up) { return up ? n - 1 - i : i; };
    const bool up[3] = {(octant & 1) != 0, (octant & 2) != 0, (octant & 4) != 0};
    for (size_t k = 0; k < n; ++k) {
      for (size_t j = 0; j < n; ++j) {
        const size_t row = n * (ordered(j, up[1]) + n * ordered(k, up[2]));
        // Rows whose cells are next along y, z and both.
        const ptrdiff_t y = up[1] ? static_cast<ptrdiff_t>(n) : -static_cast<ptrdiff_t>(n);
        const ptrdiff_t z = up[2] ? static_cast<ptrdiff_t>(n * n) : -static_cast<ptrdiff_t>(n * n);
        // Of the three rows beside this one, the least at a place; and the same one place further.
        const auto beside = [&](size_t cell) {
          uint32_t least = kFarthestOctantDistance;
          const auto look = [&](ptrdiff_t offset) {
            const size_t number = static_cast<size_t>(static_cast<ptrdiff_t>(cell) + offset);
            least = std::min(least, distances[number] >> shift & 15);
          };
          if (j > 0) look(y);
          if (k > 0) look(z);
          if (j > 0 && k > 0) look(y + z);
          return least;
        };
        uint32_t next = kFarthestOctantDistance;  // the least of the four cells one place further along x
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

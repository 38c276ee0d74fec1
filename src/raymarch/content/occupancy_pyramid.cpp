#include "raymarch/content/occupancy_pyramid.h"

#include <algorithm>

#include "base/check.h"

namespace tessera {
namespace {

// One sweep through the grid, in the order of cells or in the opposite order. The distance of a cell exceeds that of
// each of its 13 neighbours visited earlier by at most one. Whole rows are processed at a time, so that everything but
// the neighbour in the same row vectorises.
class Sweep {
 public:
  Sweep(uint32_t cells, bool forwards) : cells_(cells), forwards_(forwards), min_(cells + 2), candidate_(cells) {}

  void run(std::vector<uint8_t>& distances) {
    const int count = static_cast<int>(cells_), back = forwards_ ? -1 : 1;
    for (int i = 0; i < count; ++i) {
      const int z = forwards_ ? i : count - 1 - i;
      for (int j = 0; j < count; ++j) {
        const int y = forwards_ ? j : count - 1 - j;
        std::fill(min_.begin(), min_.end(), kFarthestDistance);
        takeRow(distances, y + back, z);
        for (int dy = -1; dy <= 1; ++dy) takeRow(distances, y + dy, z + back);
        finishRow(distances.data() + rowStart(y, z));
      }
    }
  }

 private:
  size_t rowStart(int y, int z) const { return cells_ * (static_cast<size_t>(y) + cells_ * static_cast<size_t>(z)); }

  void takeRow(const std::vector<uint8_t>& distances, int y, int z) {
    const int count = static_cast<int>(cells_);
    if (y < 0 || z < 0 || y >= count || z >= count) return;
    const uint8_t* row = distances.data() + rowStart(y, z);
    uint8_t* minimum = min_.data() + 1;
    for (size_t x = 0; x < cells_; ++x) minimum[x] = std::min(minimum[x], row[x]);
  }

  void finishRow(uint8_t* row) {
    const uint8_t* minimum = min_.data();
    for (size_t x = 0; x < cells_; ++x) {
      const uint8_t near = std::min(minimum[x], std::min(minimum[x + 1], minimum[x + 2]));
      candidate_[x] = std::min(row[x], oneMore(near));
    }
    uint8_t before = kFarthestDistance;
    for (size_t i = 0; i < cells_; ++i) {
      const size_t x = forwards_ ? i : cells_ - 1 - i;
      before = std::min(candidate_[x], oneMore(before));
      row[x] = before;
    }
  }

  static uint8_t oneMore(uint8_t distance) {
    return static_cast<uint8_t>(distance + (distance < kFarthestDistance ? 1 : 0));
  }

  size_t cells_;
  bool forwards_;
  std::vector<uint8_t> min_;        // over the rows visited earlier, with one more cell at each end
  std::vector<uint8_t> candidate_;  // the distance from all neighbours but the one in the same row
};

}  // namespace

OccupancyBits::OccupancyBits(uint32_t cellsAlongEdge) : cells(cellsAlongEdge), words((count() + 63) / 64) {}

OccupancyBits occupancyFromDistances(std::span<const uint8_t> distances, uint32_t cells) {
  OccupancyBits bits(cells);
  CHECK(distances.size() == bits.count());
  for (size_t i = 0; i < distances.size(); ++i) {
    if (distances[i] == 0) bits.set(i);
  }
  return bits;
}

OccupancyPyramid pyramidFromOccupancy(OccupancyBits finest) {
  CHECK(finest.cells >= 1u);
  OccupancyPyramid pyramid;
  pyramid.levels.push_back(std::move(finest));
  while (pyramid.levels.back().cells > 1) {
    const OccupancyBits& below = pyramid.levels.back();
    OccupancyBits above((below.cells + 1) / 2);
    size_t number = 0;
    for (uint32_t z = 0; z < below.cells; ++z) {
      for (uint32_t y = 0; y < below.cells; ++y) {
        for (uint32_t x = 0; x < below.cells; ++x) {
          if (below.at(number++)) above.set(above.number(x / 2, y / 2, z / 2));
        }
      }
    }
    pyramid.levels.push_back(std::move(above));
  }
  return pyramid;
}

OccupancyPyramid pyramidFromDistances(std::span<const uint8_t> distances, uint32_t cells) {
  return pyramidFromOccupancy(occupancyFromDistances(distances, cells));
}

std::vector<uint8_t> chebyshevDistances(const OccupancyBits& occupied) {
  std::vector<uint8_t> distances(occupied.count(), kFarthestDistance);
  for (size_t i = 0; i < distances.size(); ++i) {
    if (occupied.at(i)) distances[i] = 0;
  }
  Sweep(occupied.cells, true).run(distances);
  Sweep(occupied.cells, false).run(distances);
  return distances;
}

}  // namespace tessera

#include "tiles/occupancy_pyramid.h"

#include <algorithm>
#include <array>

#include "base/check.h"

namespace tessera {
namespace {

// The least of max(|i - j|, line[j]) over j on one side: `line` front to back. Of two candidates a newer one is better
// for good when its value is no larger, and from there on where the older one's step has reached the newer one's value:
// so the queue's values grow, and its head is the best.
class OneSide {
 public:
  explicit OneSide(size_t length) : queue_(length) {}

  template <class Line>
  void run(size_t length, const Line& at, std::vector<uint8_t>& least) {
    size_t head = 0, end = 0;
    for (size_t i = 0; i < length; ++i) {
      const size_t value = at(i);
      while (end > head && queue_[end - 1].value >= value) --end;
      queue_[end++] = {i, value};
      while (end - head >= 2 && i - queue_[head].place >= queue_[head + 1].value) ++head;
      const size_t best = std::max(i - queue_[head].place, queue_[head].value);
      least[i] = static_cast<uint8_t>(std::min<size_t>(best, kFarthestDistance));
    }
  }

 private:
  struct Candidate {
    size_t place, value;
  };
  std::vector<Candidate> queue_;
};

// In place, over the line that begins at `first`.
struct LineTransform {
  size_t length;
  OneSide side;
  std::vector<uint8_t> forward, backward;

  explicit LineTransform(size_t lineLength)
      : length(lineLength), side(lineLength), forward(lineLength), backward(lineLength) {}

  void run(uint8_t* first, size_t stride) {
    side.run(
        length, [&](size_t i) { return first[i * stride]; }, forward);
    side.run(
        length, [&](size_t i) { return first[(length - 1 - i) * stride]; }, backward);
    for (size_t i = 0; i < length; ++i) first[i * stride] = std::min(forward[i], backward[length - 1 - i]);
  }
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
  const size_t cells = occupied.cells;
  std::vector<uint8_t> distances(occupied.count(), kFarthestDistance);
  for (size_t i = 0; i < distances.size(); ++i) {
    if (occupied.at(i)) distances[i] = 0;
  }
  LineTransform transform(cells);
  const std::array<size_t, 3> strides = {1, cells, cells * cells};
  for (size_t axis = 0; axis < 3; ++axis) {
    const size_t b = strides[(axis + 1) % 3], c = strides[(axis + 2) % 3];
    for (size_t i = 0; i < cells; ++i) {
      for (size_t j = 0; j < cells; ++j) transform.run(distances.data() + i * b + j * c, strides[axis]);
    }
  }
  return distances;
}

}  // namespace tessera

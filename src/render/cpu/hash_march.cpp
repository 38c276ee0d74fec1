#include "render/cpu/hash_march.h"

#include <algorithm>
#include <cmath>

#include "tiles/occupancy_distance.h"

namespace tessera {
namespace {

// 1 - exp(-x), to a float's digits for small x too.
float opacityOf(float x) {
  return x < 0.01f ? x * (1 - x * (0.5f - x * (1.0f / 6))) : 1 - std::exp(-x);
}

// A straight piece, measured in the finest cells of the occupancy.
struct Piece {
  double start[3], direction[3], inverse[3];
  uint32_t octant = 0;

  Piece(const DomainSegment& s, double half, uint32_t cells) {
    const double toCells = cells / (2 * half);
    for (int a = 0; a < 3; ++a) {
      start[a] = (s.start[a] + half) * toCells;
      direction[a] = s.direction[a] * toCells;
      inverse[a] = direction[a] == 0 ? 0 : 1 / direction[a];
      octant |= (direction[a] > 0 ? 1u : 0u) << a;
    }
  }
};

// How far a ray may go from an empty place without coming to anything.
class Leap {
 public:
  Leap(const HashPart& part, bool useDistances)
      : part_(part),
        levels_(part.occupied.levels),
        useDistances_(useDistances),
        distanceLevel_(HashPart::distanceLevel(part.cells())) {
    while (coarsest_ + 1 < levels_.size() && levels_[coarsest_ + 1].cells >= kCoarsestCells) ++coarsest_;
  }

  // The place along the piece, in the domain, of a cell.
  double from(const Piece& piece, const uint32_t cell[3]) const {
    if (useDistances_) {
      const size_t level = distanceLevel_;
      const OccupancyBits& grid = levels_[level];
      const uint32_t at[3] = {cell[0] >> level, cell[1] >> level, cell[2] >> level};
      const uint32_t free = octantDistance(part_.distances[grid.number(at[0], at[1], at[2])], piece.octant);
      if (free > 0) return leavesLevel(piece, at, level, free);
    }
    size_t level = useDistances_ ? distanceLevel_ : coarsest_;
    while (level > 0 && levels_[level].at(cell[0] >> level, cell[1] >> level, cell[2] >> level)) --level;
    const uint32_t at[3] = {cell[0] >> level, cell[1] >> level, cell[2] >> level};
    return leavesLevel(piece, at, level, 1);
  }

 private:
  static constexpr uint32_t kCoarsestCells = 32;  // of the occupancy's levels that are looked into
  static constexpr double kSlack = 1e-5;          // finest cells: where it ends on a face, the next cell begins

  static double leavesLevel(const Piece& piece, const uint32_t at[3], size_t level, uint32_t free) {
    const uint32_t finest[3] = {at[0] << level, at[1] << level, at[2] << level};
    const double width = static_cast<double>(1u << level);
    double least = 1e30;
    for (int a = 0; a < 3; ++a) {
      if (piece.direction[a] == 0) continue;
      const double face =
          piece.direction[a] > 0 ? finest[a] + width * free - kSlack : finest[a] + width - width * free + kSlack;
      least = std::min(least, (face - piece.start[a]) * piece.inverse[a]);
    }
    return least;
  }

  const HashPart& part_;
  const std::vector<OccupancyBits>& levels_;
  bool useDistances_;
  size_t distanceLevel_, coarsest_ = 0;
};

// A sample that has been found, whose bytes are being fetched.
struct FoundSample {
  HashFeatures::Lookup lookup;
  float length = 0, distance = 0;
};

}  // namespace

void HashMarch::run(ContentComposite& composite, MarchCounts& counts) const {
  const HashPart& part = features.part();
  const OccupancyBits& occupied = part.occupied.levels.front();
  const Leap leap(part, settings.useDistances);
  const double half = part.halfDomain(), length = step * 2 * half, perLength = 1 / length;
  const double toUnit = 1 / (2 * half);  // a power of two
  const double cells = occupied.cells;
  FoundSample found[2];
  int waiting = -1;  // which of them
  const auto seen = [&] { return composite.transmittance * transmittanceBefore >= settings.minTransmittance; };
  const auto evaluate = [&](const FoundSample& sample) {
    float values[HashPart::kFeatures];
    features.mix(sample.lookup, values);
    const float opacity = opacityOf(std::exp(std::min(values[0], HashPart::kMostLogDensity)) * sample.length);
    const float weight = composite.transmittance * opacity;
    for (uint32_t f = 1; f < HashPart::kFeatures; ++f) composite.values[f - 1] += weight * values[f];
    composite.depth += weight * sample.distance;
    composite.transmittance *= 1 - opacity;
    ++counts.samples;
  };
  for (int number = 0; number < path.count && seen(); ++number) {
    const DomainSegment& s = path.segments[number];
    const Piece piece(s, half, occupied.cells);
    for (uint64_t i = 0; static_cast<double>(i) * length < s.length;) {
      const double begin = static_cast<double>(i) * length,
                   end = std::min(s.length, static_cast<double>(i + 1) * length);
      const double middle = 0.5 * (begin + end);
      float place[3];
      uint32_t cell[3];
      for (int a = 0; a < 3; ++a) {
        const double p = std::clamp((s.start[a] + middle * s.direction[a] + half) * toUnit, 0.0, 1.0);
        place[a] = static_cast<float>(p);
        cell[a] = std::min(static_cast<uint32_t>(p * cells), occupied.cells - 1);
      }
      ++counts.steps;
      if (!occupied.at(cell[0], cell[1], cell[2])) {
        ++i;
        if (!settings.skipEmptySpace) continue;
        // The first step whose middle lies there or beyond.
        const double next = std::ceil(leap.from(piece, cell) * perLength - 0.5);
        if (next > static_cast<double>(i)) i = static_cast<uint64_t>(std::min(next, 1e15));
        continue;
      }
      const uint64_t sample = i++;
      FoundSample& now = found[waiting == 0 ? 1 : 0];
      if (!features.find(place, now.lookup)) continue;
      now.length = static_cast<float>(std::min(s.distanceBetween(begin, end), HashPart::kLongestStep));
      now.distance = static_cast<float>(s.distanceAt(middle));
      // What was found before is mixed while this one's bytes come.
      if (waiting >= 0) {
        evaluate(found[waiting]);
        if (!seen()) return;
      }
      waiting = waiting == 0 ? 1 : 0;
      if (evaluated != nullptr) evaluated->push_back(static_cast<uint64_t>(number) << 32 | sample);
    }
  }
  if (waiting >= 0) evaluate(found[waiting]);
}

}  // namespace tessera

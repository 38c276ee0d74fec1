#include "render/cpu/hash_march.h"

#include <algorithm>
#include <cmath>

#include "tiles/occupancy_distance.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "render/cpu/hash_march.cpp"
#include <hwy/foreach_target.h>
// after foreach_target
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace tessera::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

// x, y and z of one place; the fourth lane means nothing.
using Tag = hn::FixedTag<float, 4>;
using Vec = hn::Vec<Tag>;

// 1 - exp(-x), to a float's digits for small x too.
HWY_INLINE float opacityOf(float x) {
  return x < 0.01f ? x * (1 - x * (0.5f - x * (1.0f / 6))) : 1 - std::exp(-x);
}

HWY_ATTR HWY_INLINE Vec loaded(const double x[3], double factor, double offset) {
  alignas(16) float lanes[4];
  for (int a = 0; a < 3; ++a) lanes[a] = static_cast<float>(x[a] * factor + offset);
  lanes[3] = 0.5f;
  return hn::Load(Tag(), lanes);
}

// Which cell holds a place.
struct Cell {
  alignas(16) int32_t at[4];

  size_t numberIn(const OccupancyBits& level, size_t shift) const {
    const size_t n = level.cells;
    return static_cast<size_t>(at[0] >> shift) +
           n * (static_cast<size_t>(at[1] >> shift) + n * static_cast<size_t>(at[2] >> shift));
  }
};

// A straight piece, measured in the finest cells of the occupancy; and how far a ray may go along it from an empty
// place without coming to anything.
class Piece {
 public:
  HWY_ATTR Piece(const HashPart& part, const DomainSegment& s, bool useDistances)
      : part_(part),
        levels_(part.occupied.levels),
        useDistances_(useDistances),
        distanceLevel_(HashPart::distanceLevel(part.cells())) {
    while (coarsest_ + 1 < levels_.size() && levels_[coarsest_ + 1].cells >= kCoarsestCells) ++coarsest_;
    const double toCells = part.cells() / (2.0 * part.halfDomain());
    start_ = loaded(s.start.data(), toCells, part.halfDomain() * toCells);
    direction_ = loaded(s.direction.data(), toCells, 0);
    alignas(16) float inverse[4], up[4], sign[4];
    for (int a = 0; a < 4; ++a) {
      const double d = a < 3 ? s.direction[static_cast<size_t>(a)] * toCells : 0;
      const bool isUp = d > 0;
      if (isUp) octant_ |= 1u << a;
      up[a] = isUp ? 0.0f : 1.0f;
      sign[a] = isUp ? 1.0f : -1.0f;
      inverse[a] = d == 0 ? -1e30f : static_cast<float>(1 / d);  // never the nearest, unless it is on a face
    }
    inverse_ = hn::Load(Tag(), inverse);
    up_ = hn::Load(Tag(), up);
    sign_ = hn::Load(Tag(), sign);
  }

  // The place at a length, in cells, within the domain.
  HWY_ATTR HWY_INLINE Vec at(float length) const {
    const Tag d;
    const Vec most = hn::Set(d, static_cast<float>(part_.cells()) * (1 - 6e-8f));
    return hn::Min(hn::Max(hn::MulAdd(direction_, hn::Set(d, length), start_), hn::Zero(d)), most);
  }

  // The length up to which nothing is; negative where the cell is occupied.
  HWY_ATTR HWY_INLINE float emptyUpTo(const Cell& cell) const {
    size_t level = useDistances_ ? distanceLevel_ : coarsest_;
    if (useDistances_) {
      const uint32_t free = octantDistance(part_.distances[cell.numberIn(levels_[level], level)], octant_);
      if (free > 0) return leaves(cell, level, free);
      if (level == 0) return -1;
      --level;
    }
    // The largest empty cell that holds the place.
    for (;; --level) {
      if (!levels_[level].at(cell.numberIn(levels_[level], level))) return leaves(cell, level, 1);
      if (level == 0) return -1;
    }
  }

 private:
  static constexpr uint32_t kCoarsestCells = 32;  // of the occupancy's levels that are looked into
  // Finest cells: more than what places are rounded by.
  static constexpr float kSlack = 1e-3f;

  // A cube of so many cells of a level along an edge that begins at the cell and lies in the piece's octant.
  HWY_ATTR HWY_INLINE float leaves(const Cell& cell, size_t level, uint32_t free) const {
    const Tag d;
    const hn::RebindToSigned<Tag> integers;
    const int shift = static_cast<int>(level);
    const auto from = hn::ConvertTo(d, hn::ShiftRightSame(hn::Load(integers, cell.at), shift));
    const auto face = hn::MulAdd(sign_, hn::Set(d, static_cast<float>(free)), hn::Add(from, up_));
    const auto slack = hn::Mul(sign_, hn::Set(d, kSlack));
    const auto inCells = hn::MulSub(face, hn::Set(d, static_cast<float>(1u << level)), slack);
    alignas(16) float along[4];
    hn::Store(hn::Mul(hn::Sub(inCells, start_), inverse_), d, along);
    return std::min(std::min(along[0], along[1]), along[2]);
  }

  const HashPart& part_;
  const std::vector<OccupancyBits>& levels_;
  bool useDistances_;
  size_t distanceLevel_, coarsest_ = 0;
  uint32_t octant_ = 0;
  Vec start_, direction_, inverse_, up_, sign_;
};

// A sample that has been found, whose bytes are being fetched.
struct FoundSample {
  HashFeatures::Lookup lookup;
  float length = 0, distance = 0;
};

HWY_ATTR void marchHash(const HashMarch& march, ContentComposite& composite, MarchCounts& counts) {
  const Tag d;
  const hn::RebindToSigned<Tag> integers;
  const auto& [features, step, path, settings, transmittanceBefore, evaluated] = march;
  const HashPart& part = features.part();
  const OccupancyBits& occupied = part.occupied.levels.front();
  const double length = step * 2 * part.halfDomain();
  const float perLength = static_cast<float>(1 / length);
  const Vec toUnit = hn::Set(d, 1 / static_cast<float>(occupied.cells));
  FoundSample found[2];
  int waiting = -1;  // which of them
  const float least = settings.minTransmittance / transmittanceBefore;
  const auto seen = [&] { return composite.transmittance >= least; };
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
    const DomainSegment& s = path.segments[static_cast<size_t>(number)];
    const Piece piece(part, s, settings.useDistances);
    const uint64_t steps = static_cast<uint64_t>(std::ceil(std::min(s.length / length, 1e15)));
    for (uint64_t i = 0; i < steps;) {
      const double begin = static_cast<double>(i) * length,
                   end = std::min(s.length, static_cast<double>(i + 1) * length);
      const double middle = 0.5 * (begin + end);
      const Vec at = piece.at(static_cast<float>(middle));
      Cell cell;
      hn::Store(hn::ConvertTo(integers, at), integers, cell.at);
      ++counts.steps;
      if (!settings.skipEmptySpace) {
        if (!occupied.at(cell.numberIn(occupied, 0))) {
          ++i;
          continue;
        }
      } else if (const float empty = piece.emptyUpTo(cell); empty >= 0) {
        // The first step whose middle lies there or beyond.
        ++i;
        const float next = std::ceil(empty * perLength - 0.5f);
        if (next > static_cast<float>(i)) i = static_cast<uint64_t>(std::min(next, 1e15f));
        continue;
      }
      const uint64_t sample = i++;
      alignas(16) float place[4];
      hn::Store(hn::Mul(at, toUnit), d, place);
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

}  // namespace tessera::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace tessera {

HWY_EXPORT(marchHash);

void HashMarch::run(ContentComposite& composite, MarchCounts& counts) const {
  HWY_DYNAMIC_DISPATCH(marchHash)(*this, composite, counts);
}

}  // namespace tessera
#endif

#include "representations/hash/cpu/hash_march.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>
#include <new>

#include "representations/hash/content/occupancy_distance.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "representations/hash/cpu/hash_march.cpp"
#include <hwy/foreach_target.h>
// These must follow foreach_target.h.
#include <hwy/contrib/math/math-inl.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace tessera::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

// Holds x, y and z of one place; the fourth lane is unused.
using Tag = hn::FixedTag<float, 4>;
using Vec = hn::Vec<Tag>;

HWY_ATTR HWY_INLINE Vec loaded(const double x[3], double factor, double offset) {
  alignas(16) float lanes[4];
  for (int a = 0; a < 3; ++a) lanes[a] = static_cast<float>(x[a] * factor + offset);
  lanes[3] = 0.5f;
  return hn::Load(Tag(), lanes);
}

// The finest cell that contains a place.
struct Cell {
  alignas(16) int32_t at[4];

  // Returns the index of this cell's cell in a grid of n cells along an edge, each 2^shift finest cells wide.
  size_t numberIn(size_t n, size_t shift) const {
    return static_cast<size_t>(at[0] >> shift) +
           n * (static_cast<size_t>(at[1] >> shift) + n * static_cast<size_t>(at[2] >> shift));
  }
  // Returns the index of this cell among the finest cells of its coarse cell, which is 2^shift finest cells wide.
  size_t numberWithin(uint32_t shift) const {
    const uint32_t mask = (1u << shift) - 1;
    return (static_cast<uint32_t>(at[0]) & mask) + ((static_cast<uint32_t>(at[1]) & mask) << shift) +
           ((static_cast<uint32_t>(at[2]) & mask) << (2 * shift));
  }
};

// A straight segment of a path in units of the finest occupancy cells. It computes how far a ray can go along it
// through empty space.
class Piece {
 public:
  Piece() = default;
  HWY_ATTR Piece(const HashPart& part, const DomainSegment& s, bool useDistances)
      : levels_(part.occupied.levels.data()), distances_(useDistances ? &part.distances : nullptr) {
    while (coarsest_ + 1 < part.occupied.levels.size() && levels_[coarsest_ + 1].cells >= kCoarsestCells) ++coarsest_;
    coarseShift_ = static_cast<uint32_t>(std::countr_zero(part.distances.ratio));
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
      inverse[a] = d == 0 ? -1e30f : static_cast<float>(1 / d);  // never the nearest face, unless the ray lies on it
    }
    inverse_ = hn::Load(Tag(), inverse);
    up_ = hn::Load(Tag(), up);
    sign_ = hn::Load(Tag(), sign);
  }

  // Returns the place at a length along the segment, in cells, clamped to the domain.
  HWY_ATTR HWY_INLINE Vec at(float length) const {
    const Tag d;
    const Vec maximum = hn::Set(d, static_cast<float>(levels_->cells) * (1 - 6e-8f));
    return hn::Min(hn::Max(hn::MulAdd(direction_, hn::Set(d, length), start_), hn::Zero(d)), maximum);
  }

  // Returns the length along the segment up to which space is empty; a negative number if the cell is occupied.
  HWY_ATTR HWY_INLINE float emptyUpTo(const Cell& cell) const {
    if (distances_ != nullptr) {
      const uint32_t word = distances_->coarse[cell.numberIn(distances_->cells, coarseShift_)];
      if (OctantDistanceField::isEmpty(word)) return exitLength(cell, coarseShift_, octantDistance(word, octant_));
      if (coarseShift_ == 0) return -1;
      const size_t finest = ((size_t{word} >> 4) << (3 * coarseShift_)) + cell.numberWithin(coarseShift_);
      const uint32_t free = octantDistance(distances_->fine[finest], octant_);
      return free > 0 ? exitLength(cell, 0, free) : -1;
    }
    // Use the largest empty cell that contains the place.
    for (size_t level = coarsest_;; --level) {
      if (!levels_[level].at(cell.numberIn(levels_[level].cells, level))) return exitLength(cell, level, 1);
      if (level == 0) return -1;
    }
  }

 private:
  static constexpr uint32_t kCoarsestCells = 32;  // along an edge of the coarsest occupancy level used
  // In finest cells. This exceeds the rounding error of places, up to 1024 cells along an edge.
  static constexpr float kSlack = 1e-3f;

  // Returns the length at which the ray leaves a cube that begins at the cell and extends into the segment's octant.
  // `free` is the width of the cube in cells of the level.
  HWY_ATTR HWY_INLINE float exitLength(const Cell& cell, size_t level, uint32_t free) const {
    const Tag d;
    const hn::RebindToSigned<Tag> integers;
    const int shift = static_cast<int>(level);
    const auto from = hn::ConvertTo(d, hn::ShiftRightSame(hn::Load(integers, cell.at), shift));
    const auto face = hn::MulAdd(sign_, hn::Set(d, static_cast<float>(free)), hn::Add(from, up_));
    const auto slack = hn::Mul(sign_, hn::Set(d, kSlack));
    const auto inCells = hn::MulSub(face, hn::Set(d, static_cast<float>(1u << level)), slack);
    alignas(16) float along[4];
    hn::Store(hn::Mul(hn::Sub(inCells, start_), inverse_), d, along);
    return std::max(0.0f, std::min(std::min(along[0], along[1]), along[2]));  // a negative result would mean occupied
  }

  const OccupancyBits* levels_ = nullptr;
  const OctantDistanceField* distances_ = nullptr;  // null: not used
  uint32_t coarseShift_ = 0;                        // log2 of the width of coarse cells
  size_t coarsest_ = 0;                             // coarsest level used without distances
  uint32_t octant_ = 0;
  Vec start_, direction_, inverse_, up_, sign_;
};

// Moves one ray from sample to sample.
class DdaCursor {
 public:
  HWY_ATTR DdaCursor(const HashMarch& march, HashRay& ray)
      : march_(march), ray_(ray), min_(march.settings.minTransmittance / ray.transmittanceBefore) {
    length_ = march.step * 2 * part().halfDomain();
    enter();
  }

  bool isActive() const { return ray_.composite.transmittance >= min_; }

  // Finds the next sample and prefetches its bytes. Returns false if there is none.
  HWY_ATTR bool find(MarchCounts& counts) {
    const Tag d;
    const hn::RebindToSigned<Tag> integers;
    const OccupancyBits& occupied = part().occupied.levels.front();
    const float perLength = static_cast<float>(1 / length_);
    for (; number_ < ray_.path.count; ++number_, enter()) {
      const DomainSegment& s = ray_.path.segments[static_cast<size_t>(number_)];
      while (step_ < steps_) {
        const double begin = static_cast<double>(step_) * length_;
        const double end = std::min(s.length, static_cast<double>(step_ + 1) * length_);
        const double middle = 0.5 * (begin + end);
        const Vec at = piece_.at(static_cast<float>(middle));
        Cell cell;
        hn::Store(hn::ConvertTo(integers, at), integers, cell.at);
        ++counts.steps;
        const uint64_t step = step_++;
        if (!march_.settings.skipEmptySpace) {
          if (!occupied.at(cell.numberIn(occupied.cells, 0))) continue;
        } else if (const float empty = piece_.emptyUpTo(cell); empty >= 0) {
          // Continue with the first step whose middle lies at or beyond that length.
          const float next = std::ceil(empty * perLength - 0.5f);
          if (next > static_cast<float>(step_)) step_ = static_cast<uint64_t>(std::min(next, 1e15f));
          continue;
        }
        alignas(16) float place[4];
        hn::Store(hn::Mul(at, hn::Set(d, 1 / static_cast<float>(occupied.cells))), d, place);
        if (!march_.features.find(place, lookup_)) continue;
        sampleLength_ = static_cast<float>(std::min(s.distanceBetween(begin, end), HashPart::kLongestStep));
        sampleDistance_ = static_cast<float>(s.distanceAt(middle));
        if (ray_.evaluated != nullptr) ray_.evaluated->push_back(static_cast<uint64_t>(number_) << 32 | step);
        return true;
      }
    }
    return false;
  }

  const HashFeatures::Lookup& lookup() const { return lookup_; }
  float sampleLength() const { return sampleLength_; }

  // Composites the sample that was found last.
  HWY_ATTR HWY_INLINE void add(const float features[HashPart::kFeatures], float opacity) {
    ContentComposite& composite = ray_.composite;
    const float weight = composite.transmittance * opacity;
    for (uint32_t f = 1; f < HashPart::kFeatures; ++f) composite.values[f - 1] += weight * features[f];
    composite.depth += weight * sampleDistance_;
    composite.transmittance *= 1 - opacity;
  }

 private:
  const HashPart& part() const { return march_.features.part(); }
  HWY_ATTR void enter() {
    if (number_ >= ray_.path.count) return;
    const DomainSegment& s = ray_.path.segments[static_cast<size_t>(number_)];
    piece_ = Piece(part(), s, march_.settings.useDistances);
    step_ = 0;
    steps_ = static_cast<uint64_t>(std::ceil(std::min(s.length / length_, 1e15)));
  }

  const HashMarch& march_;
  HashRay& ray_;
  float min_;
  double length_;  // of a step, in domain units
  int number_ = 0;
  Piece piece_;
  uint64_t step_ = 0, steps_ = 0;
  HashFeatures::Lookup lookup_;
  float sampleLength_ = 0, sampleDistance_ = 0;
};

constexpr size_t kTogether = 8;  // rays marched in an interleaved way

// Computes opacities 1 - exp(-x) with x = density · length, to float precision for small x as well.
HWY_ATTR void computeOpacities(const float* logDensity, const float* length, float* opacity) {
  const hn::CappedTag<float, kTogether> d;
  for (size_t i = 0; i < kTogether; i += hn::Lanes(d)) {
    const auto density = hn::Exp(d, hn::Min(hn::Load(d, logDensity + i), hn::Set(d, HashPart::kMaxLogDensity)));
    const auto x = hn::Mul(density, hn::Load(d, length + i));
    const auto small =
        hn::Mul(x, hn::NegMulAdd(x, hn::NegMulAdd(x, hn::Set(d, 1.0f / 6), hn::Set(d, 0.5f)), hn::Set(d, 1.0f)));
    const auto large = hn::Sub(hn::Set(d, 1.0f), hn::Exp(d, hn::Neg(x)));
    hn::Store(hn::IfThenElse(hn::Lt(x, hn::Set(d, 0.01f)), small, large), d, opacity + i);
  }
}

HWY_ATTR void marchHash(const HashMarch& march, std::span<HashRay* const> rays, MarchCounts& counts) {
  alignas(64) float logDensity[kTogether] = {}, length[kTogether] = {}, opacity[kTogether];
  float features[kTogether][HashPart::kFeatures];
  for (size_t first = 0; first < rays.size(); first += kTogether) {
    alignas(64) std::byte storage[kTogether][sizeof(DdaCursor)];
    DdaCursor* active[kTogether];
    size_t count = 0;
    for (size_t i = first; i < std::min(first + kTogether, rays.size()); ++i) {
      DdaCursor* cursor = new (storage[i - first]) DdaCursor(march, *rays[i]);
      if (cursor->isActive()) active[count++] = cursor;
    }
    while (count > 0) {
      size_t sampled = 0;  // rays that have another sample
      for (size_t i = 0; i < count; ++i) {
        if (active[i]->find(counts)) active[sampled++] = active[i];
      }
      counts.samples += sampled;
      for (size_t i = 0; i < sampled; ++i) {
        march.features.mix(active[i]->lookup(), features[i]);
        logDensity[i] = features[i][0];
        length[i] = active[i]->sampleLength();
      }
      computeOpacities(logDensity, length, opacity);
      count = 0;
      for (size_t i = 0; i < sampled; ++i) {
        active[i]->add(features[i], opacity[i]);
        if (active[i]->isActive()) active[count++] = active[i];
      }
    }
  }
}

}  // namespace tessera::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace tessera {

HWY_EXPORT(marchHash);

void HashMarch::run(std::span<HashRay* const> rays, MarchCounts& counts) const {
  HWY_DYNAMIC_DISPATCH(marchHash)(*this, rays, counts);
}

}  // namespace tessera
#endif

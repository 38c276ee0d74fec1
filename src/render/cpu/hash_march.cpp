#include "render/cpu/hash_march.h"

#include <algorithm>
#include <cmath>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "render/cpu/hash_march.cpp"
#include <hwy/foreach_target.h>
// after foreach_target
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace tessera::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

constexpr uint32_t kFeatures = HashPart::kFeatures;
constexpr float kMostDensity = 15;       // of the logarithm
constexpr double kLongestStep = 1e3;     // scene units, as in training
constexpr uint32_t kCoarsestCells = 32;  // of the occupancy's levels that are looked into

// Eight bytes as numbers: one vector, or two.
using Tag = hn::CappedTag<float, 8>;
constexpr size_t kLanes = hn::MaxLanes(Tag()), kVectors = 8 / kLanes;

struct Eight {
  hn::Vec<Tag> v[kVectors];
};

HWY_ATTR HWY_INLINE Eight zero() {
  Eight sum;
  for (size_t i = 0; i < kVectors; ++i) sum.v[i] = hn::Zero(Tag());
  return sum;
}

HWY_ATTR HWY_INLINE void addBytes(const uint8_t* bytes, float weight, Eight& sum) {
  const Tag d;
  const hn::Rebind<int32_t, Tag> integers;
  const hn::Rebind<uint8_t, Tag> eight;
  const auto w = hn::Set(d, weight);
  for (size_t i = 0; i < kVectors; ++i) {
    const auto value = hn::ConvertTo(d, hn::PromoteTo(integers, hn::LoadU(eight, bytes + i * kLanes)));
    sum.v[i] = hn::MulAdd(w, value, sum.v[i]);
  }
}

HWY_ATTR HWY_INLINE void store(const Eight& sum, float* to) {
  for (size_t i = 0; i < kVectors; ++i) hn::StoreU(sum.v[i], Tag(), to + i * kLanes);
}

float sigmoid(float x) {
  return 1 / (1 + std::exp(-x));
}

// 1 - exp(-x), to a float's digits for small x too.
float opacityOf(float x) {
  return x < 0.01f ? x * (1 - x * (0.5f - x * (1.0f / 6))) : 1 - std::exp(-x);
}

// Bytes of the eight corners around the place, mixed: columns of the lattice.
HWY_ATTR bool mixCorners(const HashPart& part, const float place[3], float* columns) {
  float fraction[3];
  uint32_t block[3], within[3];
  const uint32_t blocks = part.lattice / HashPart::kMacroblock;
  for (int a = 0; a < 3; ++a) {
    const float resolution = static_cast<float>(part.lattice);
    const float u = std::min(std::max(place[a] * resolution - 0.5f, 0.0f), resolution - 1);
    const uint32_t index = static_cast<uint32_t>(u);
    fraction[a] = u - static_cast<float>(index);
    block[a] = index / HashPart::kMacroblock;
    within[a] = index % HashPart::kMacroblock;
  }
  const uint32_t stored = part.macroblocks[block[0] + blocks * (block[1] + size_t{blocks} * block[2])];
  if (stored == HashPart::kEmpty) return false;
  const size_t stride = part.columns;
  constexpr size_t kEdge = HashPart::kStoredEdge;
  const uint8_t* corner = part.cornerBytes.data() + stride * (size_t{stored} * HashPart::kCorners + within[0] +
                                                              kEdge * (within[1] + kEdge * within[2]));
  const bool two = part.columns > kFeatures;
  Eight low = zero(), high = zero();
  for (int k = 0; k < 8; ++k) {
    const int x = k & 1, y = k >> 1 & 1, z = k >> 2;
    const float weight =
        (x ? fraction[0] : 1 - fraction[0]) * (y ? fraction[1] : 1 - fraction[1]) * (z ? fraction[2] : 1 - fraction[2]);
    const uint8_t* bytes =
        corner + stride * (static_cast<size_t>(x) + kEdge * (static_cast<size_t>(y) + kEdge * static_cast<size_t>(z)));
    addBytes(bytes, weight, low);
    if (two) addBytes(bytes + kFeatures, weight, high);
  }
  store(low, columns);
  if (two) store(high, columns + kFeatures);
  for (uint32_t c = 0; c < part.columns; ++c) columns[c] = part.ranges[c].low + part.ranges[c].scale() * columns[c];
  return true;
}

HWY_ATTR void mixTable(const HashTable& table, const float place[3], float values[8]) {
  uint32_t index[3];
  float fraction[3];
  for (int a = 0; a < 3; ++a) {
    const float at = place[a] * static_cast<float>(table.resolution - 1) + 0.5f;
    index[a] = static_cast<uint32_t>(at);
    fraction[a] = at - static_cast<float>(index[a]);
  }
  Eight sum = zero();
  for (uint32_t k = 0; k < 8; ++k) {
    const uint32_t x = index[0] + (k & 1), y = index[1] + (k >> 1 & 1), z = index[2] + (k >> 2);
    const uint32_t entry = table.hashed ? (x ^ (y * 2654435761u) ^ (z * 805459861u)) & (table.entries - 1)
                                        : (x + table.resolution * (y + table.resolution * z)) % table.entries;
    const float weight = (k & 1 ? fraction[0] : 1 - fraction[0]) * (k & 2 ? fraction[1] : 1 - fraction[1]) *
                         (k & 4 ? fraction[2] : 1 - fraction[2]);
    addBytes(table.bytes.data() + size_t{8} * entry, weight, sum);
  }
  store(sum, values);
  for (int f = 0; f < 8; ++f) values[f] = table.ranges[f].low + table.ranges[f].scale() * values[f];
}

HWY_ATTR bool featuresAt(const HashContent& content, const HashPart& part, const float place[3], float features[8]) {
  float columns[2 * kFeatures], fine[kFeatures];
  if (!mixCorners(part, place, columns)) return false;
  std::copy_n(columns, kFeatures, features);
  const float* logits = content.logits.empty() ? columns + kFeatures : content.logits.data();
  for (size_t l = 0; l < part.tables.size(); ++l) {
    mixTable(part.tables[l], place, fine);
    float ofDensity = 1, ofColours = 1;
    if (content.weights == LevelWeights::shared) ofDensity = ofColours = sigmoid(logits[l]);
    if (content.weights == LevelWeights::separate) {
      ofDensity = sigmoid(logits[2 * l]);
      ofColours = sigmoid(logits[2 * l + 1]);
    }
    features[0] += ofDensity * fine[0];
    for (uint32_t f = 1; f < kFeatures; ++f) features[f] += ofColours * fine[f];
  }
  return true;
}

// How far a ray may go from an empty place without coming to anything, in the domain.
class Leap {
 public:
  Leap(const HashMarch& march) : part_(march.part), useDistances_(march.useDistances), half_(part_.halfDomain()) {
    const std::vector<OccupancyBits>& levels = part_.occupied.levels;
    while (coarsest_ + 1 < levels.size() && levels[coarsest_ + 1].cells >= kCoarsestCells) ++coarsest_;
  }

  double from(const DomainSegment& s, double middle, const uint32_t cell[3]) const {
    const std::vector<OccupancyBits>& levels = part_.occupied.levels;
    size_t level = coarsest_;
    while (level > 0 && levels[level].at(cell[0] >> level, cell[1] >> level, cell[2] >> level)) --level;
    // Of a finest cell, in the domain; all levels' cells are whole numbers of it.
    const double edge = 2 * half_ / part_.cells();
    double jump = 1e30;
    for (int a = 0; a < 3; ++a) {
      const double d = s.direction[a];
      if (d == 0) continue;
      const uint32_t index = (cell[a] >> level) + (d > 0 ? 1 : 0);
      const double face = static_cast<double>(index << level) * edge - half_;
      jump = std::min(jump, (face - s.start[a]) / d - middle);
    }
    // The grid of distances is as fine as level 1: no use beside what is finer.
    if (useDistances_ && level > 1) {
      const uint32_t cells = levels[1].cells;
      const uint8_t free = part_.distances[(cell[0] >> 1) + cells * ((cell[1] >> 1) + size_t{cells} * (cell[2] >> 1))];
      jump = std::max(jump, free * 2 * edge);
    }
    return jump - 1e-5 * edge;  // where it ends on a face, the next cell begins
  }

 private:
  const HashPart& part_;
  bool useDistances_;
  double half_;
  size_t coarsest_ = 0;
};

HWY_ATTR void marchHash(const HashMarch& march, ContentComposite& composite, MarchCounts& counts) {
  const HashPart& part = march.part;
  const OccupancyBits& occupied = part.occupied.levels.front();
  const Leap leap(march);
  const double half = part.halfDomain(), step = march.content.step * 2 * half, cells = occupied.cells;
  const auto seen = [&] {
    return composite.transmittance * march.transmittanceBefore >= march.settings.minTransmittance;
  };
  for (int number = 0; number < march.path.count && seen(); ++number) {
    const DomainSegment& s = march.path.segments[number];
    for (uint64_t i = 0; static_cast<double>(i) * step < s.length && seen();) {
      const double begin = static_cast<double>(i) * step, end = std::min(s.length, static_cast<double>(i + 1) * step);
      const double middle = 0.5 * (begin + end);
      float place[3];
      uint32_t cell[3];
      for (int a = 0; a < 3; ++a) {
        const double p = std::clamp((s.start[a] + middle * s.direction[a] + half) / (2 * half), 0.0, 1.0);
        place[a] = static_cast<float>(p);
        cell[a] = std::min(static_cast<uint32_t>(p * cells), occupied.cells - 1);
      }
      ++counts.steps;
      if (!occupied.at(cell[0], cell[1], cell[2])) {
        const double steps = march.settings.skipEmptySpace ? std::ceil(leap.from(s, middle, cell) / step) : 1;
        i += steps > 1 ? static_cast<uint64_t>(std::min(steps, 1e9)) : 1;
        continue;
      }
      const uint64_t sample = i++;
      float features[kFeatures];
      if (!featuresAt(march.content, part, place, features)) continue;
      ++counts.samples;
      if (march.evaluated != nullptr) march.evaluated->push_back(static_cast<uint64_t>(number) << 32 | sample);
      const float length = static_cast<float>(std::min(s.distanceBetween(begin, end), kLongestStep));
      const float opacity = opacityOf(std::exp(std::min(features[0], kMostDensity)) * length);
      const float weight = composite.transmittance * opacity;
      for (uint32_t f = 1; f < kFeatures; ++f) composite.values[f - 1] += weight * features[f];
      composite.depth += weight * static_cast<float>(s.distanceAt(middle));
      composite.transmittance *= 1 - opacity;
    }
  }
}

}  // namespace tessera::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace tessera {

HWY_EXPORT(featuresAt);
HWY_EXPORT(marchHash);

void HashMarch::run(ContentComposite& composite, MarchCounts& counts) const {
  HWY_DYNAMIC_DISPATCH(marchHash)(*this, composite, counts);
}

bool hashFeatures(const HashContent& content, const HashPart& part, const float place[3], float features[8]) {
  return HWY_DYNAMIC_DISPATCH(featuresAt)(content, part, place, features);
}

}  // namespace tessera
#endif

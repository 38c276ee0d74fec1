#include "representations/hash/cpu/hash_features.h"

#include <hwy/cache_control.h>

#include <algorithm>
#include <cmath>

#include "base/check.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "representations/hash/cpu/hash_features.cpp"
#include <hwy/foreach_target.h>
// These must follow foreach_target.h.
#include <hwy/contrib/math/math-inl.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace tessera::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

constexpr uint32_t kFeatures = HashPart::kFeatures;
constexpr size_t kEdge = HashPart::kStoredEdge;

// Eight bytes as floats, in one vector or two.
using Tag = hn::CappedTag<float, 8>;
constexpr size_t kLanes = hn::MaxLanes(Tag()), kVectors = 8 / kLanes;

struct Lanes8 {
  hn::Vec<Tag> v[kVectors];
};

HWY_ATTR HWY_INLINE Lanes8 zero() {
  Lanes8 sum;
  for (size_t i = 0; i < kVectors; ++i) sum.v[i] = hn::Zero(Tag());
  return sum;
}

HWY_ATTR HWY_INLINE Lanes8 load(const float* from) {
  Lanes8 values;
  for (size_t i = 0; i < kVectors; ++i) values.v[i] = hn::LoadU(Tag(), from + i * kLanes);
  return values;
}

HWY_ATTR HWY_INLINE void store(const Lanes8& sum, float* to) {
  for (size_t i = 0; i < kVectors; ++i) hn::StoreU(sum.v[i], Tag(), to + i * kLanes);
}

HWY_ATTR HWY_INLINE void addBytes(const uint8_t* bytes, float weight, Lanes8& sum) {
  const Tag d;
  const hn::Rebind<int32_t, Tag> integers;
  const hn::Rebind<uint8_t, Tag> eight;
  const auto w = hn::Set(d, weight);
  for (size_t i = 0; i < kVectors; ++i) {
    const auto value = hn::ConvertTo(d, hn::PromoteTo(integers, hn::LoadU(eight, bytes + i * kLanes)));
    sum.v[i] = hn::MulAdd(w, value, sum.v[i]);
  }
}

// low + step · mix
HWY_ATTR HWY_INLINE Lanes8 dequantised(const float* low, const float* step, const Lanes8& mix) {
  Lanes8 values;
  for (size_t i = 0; i < kVectors; ++i) {
    values.v[i] = hn::MulAdd(hn::LoadU(Tag(), step + i * kLanes), mix.v[i], hn::LoadU(Tag(), low + i * kLanes));
  }
  return values;
}

// Bits 0, 1 and 2 of k, the number of one of the eight corners, are its offsets along x, y and z.
constexpr uint32_t kPrimeY = 2654435761u, kPrimeZ = 805459861u;  // as in Instant-NGP
alignas(32) constexpr uint32_t kHashX[8] = {0, 1, 0, 1, 0, 1, 0, 1};
alignas(32) constexpr uint32_t kHashY[8] = {0, 0, kPrimeY, kPrimeY, 0, 0, kPrimeY, kPrimeY};
alignas(32) constexpr uint32_t kHashZ[8] = {0, 0, 0, 0, kPrimeZ, kPrimeZ, kPrimeZ, kPrimeZ};

// Computes the trilinear weights of the eight corners.
HWY_ATTR HWY_INLINE void cornerWeights(const float fraction[3], float* weights) {
  const float x = fraction[0], y = fraction[1], z = fraction[2];
  const float low[4] = {(1 - x) * (1 - y), x * (1 - y), (1 - x) * y, x * y};
  for (int k = 0; k < 4; ++k) {
    weights[k] = low[k] * (1 - z);
    weights[4 + k] = low[k] * z;
  }
}

HWY_ATTR bool findPosition(const HashFeatures::Layout& layout, const HashPart& part, const float position[3],
                           HashFeatures::Lookup& lookup) {
  uint32_t block[3], within[3];
  for (int a = 0; a < 3; ++a) {
    const float u = std::min(std::max(position[a] * layout.lattice - 0.5f, 0.0f), layout.lattice - 1);
    const uint32_t index = static_cast<uint32_t>(u);
    lookup.cornerFraction[a] = u - static_cast<float>(index);
    block[a] = index / HashPart::kMacroblock;
    within[a] = index % HashPart::kMacroblock;
  }
  const size_t n = layout.macroblocks;
  const uint32_t stored = part.macroblocks[block[0] + n * (block[1] + n * block[2])];
  if (stored == HashPart::kEmpty) return false;
  lookup.corner = part.cornerBytes.data() +
                  size_t{layout.columns} *
                      (size_t{stored} * HashPart::kStoredTexels + within[0] + kEdge * (within[1] + kEdge * within[2]));
  for (size_t k = 0; k < 4; ++k) {
    hwy::Prefetch(lookup.corner + layout.columns * ((k & 1) * kEdge + (k >> 1) * kEdge * kEdge));
  }
  for (size_t l = 0; l < layout.tables.size(); ++l) {
    const HashFeatures::Table& table = layout.tables[l];
    uint32_t index[3];
    for (int a = 0; a < 3; ++a) {
      const float at = position[a] * table.scale + 0.5f;
      index[a] = static_cast<uint32_t>(at);
      lookup.fraction[l][a] = at - static_cast<float>(index[a]);
    }
    uint32_t* entry = lookup.entry[l];
    if (table.hashed) {
      const hn::RebindToUnsigned<Tag> d;
      const auto x = hn::Set(d, index[0]), y = hn::Set(d, index[1] * kPrimeY), z = hn::Set(d, index[2] * kPrimeZ);
      const auto mask = hn::Set(d, table.mask);
      for (size_t i = 0; i < 8; i += kLanes) {
        const auto xy = hn::Xor(hn::Add(x, hn::Load(d, kHashX + i)), hn::Add(y, hn::Load(d, kHashY + i)));
        hn::Store(hn::And(hn::Xor(xy, hn::Add(z, hn::Load(d, kHashZ + i))), mask), d, entry + i);
      }
    } else {
      for (uint32_t k = 0; k < 8; ++k) {
        const uint32_t x = index[0] + (k & 1), y = index[1] + (k >> 1 & 1), z = index[2] + (k >> 2);
        entry[k] = (x + table.resolution * (y + table.resolution * z)) % table.entries;
      }
    }
    for (uint32_t k = 0; k < 8; ++k) hwy::Prefetch(table.bytes + size_t{8} * entry[k]);
  }
  return true;
}

HWY_ATTR void mixPlace(const HashFeatures::Layout& layout, const HashFeatures::Lookup& lookup, float features[8]) {
  const Tag d;
  alignas(32) float weight[8];
  cornerWeights(lookup.cornerFraction, weight);
  Lanes8 low = zero(), high = zero();
  for (size_t k = 0; k < 8; ++k) {
    const uint8_t* bytes = lookup.corner + layout.columns * ((k & 1) + kEdge * (k >> 1 & 1) + kEdge * kEdge * (k >> 2));
    addBytes(bytes, weight[k], low);
    if (layout.varies) addBytes(bytes + kFeatures, weight[k], high);
  }
  Lanes8 sum = dequantised(layout.low.data(), layout.step.data(), low);
  alignas(64) float sigmoids[2 * HashFeatures::kMaxTables];
  const float* levelWeights = layout.weights.data();
  if (layout.varies) {
    const Lanes8 logits = dequantised(layout.low.data() + 8, layout.step.data() + 8, high);
    Lanes8 ones;
    for (size_t i = 0; i < kVectors; ++i) {
      const auto logit = hn::Max(logits.v[i], hn::Set(d, -80.0f));  // Exp is not defined beyond this
      ones.v[i] = hn::Div(hn::Set(d, 1.0f), hn::Add(hn::Set(d, 1.0f), hn::Exp(d, hn::Neg(logit))));
    }
    store(ones, sigmoids);
    levelWeights = sigmoids;
  }
  for (size_t l = 0; l < layout.tables.size(); ++l) {
    const HashFeatures::Table& table = layout.tables[l];
    cornerWeights(lookup.fraction[l], weight);
    Lanes8 fine = zero();
    for (size_t k = 0; k < 8; ++k) addBytes(table.bytes + size_t{8} * lookup.entry[l][k], weight[k], fine);
    fine = dequantised(table.low.data(), table.step.data(), fine);
    const size_t first = layout.logitsOfLevel * l;
    const auto colourWeight = hn::Set(d, levelWeights[layout.logitsOfLevel == 2 ? first + 1 : first]);
    for (size_t i = 0; i < kVectors; ++i) {
      const auto w =
          i == 0 ? hn::IfThenElse(hn::FirstN(d, 1), hn::Set(d, levelWeights[first]), colourWeight) : colourWeight;
      sum.v[i] = hn::MulAdd(w, fine.v[i], sum.v[i]);
    }
  }
  store(sum, features);
}

}  // namespace tessera::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace tessera {

HWY_EXPORT(findPosition);
HWY_EXPORT(mixPlace);

HashFeatures::HashFeatures(const HashContent& content, const HashPart& part) : part_(&part), layout_{} {
  CHECK(part.tables.size() <= kMaxTables);
  layout_.lattice = static_cast<float>(part.lattice);
  layout_.macroblocks = part.lattice / HashPart::kMacroblock;
  layout_.columns = part.columns;
  for (size_t c = 0; c < part.columns; ++c) {
    layout_.low[c] = part.ranges[c].low;
    layout_.step[c] = part.ranges[c].scale();
  }
  for (const HashTable& from : part.tables) {
    Table table{from.bytes.data(),
                static_cast<float>(from.resolution - 1),
                from.resolution,
                from.entries,
                from.entries - 1,
                from.hashed,
                {},
                {}};
    for (size_t f = 0; f < HashPart::kFeatures; ++f) {
      table.low[f] = from.ranges[f].low;
      table.step[f] = from.ranges[f].scale();
    }
    layout_.tables.push_back(table);
  }
  layout_.logitsOfLevel = content.logitsOfLevel();
  layout_.varies = part.columns > HashPart::kFeatures;
  layout_.weights.fill(1);  // of levels without logits
  for (size_t i = 0; i < content.logits.size(); ++i) layout_.weights[i] = 1 / (1 + std::exp(-content.logits[i]));
}

bool HashFeatures::find(const float position[3], Lookup& lookup) const {
  return HWY_DYNAMIC_DISPATCH(findPosition)(layout_, *part_, position, lookup);
}

void HashFeatures::mix(const Lookup& lookup, float features[8]) const {
  HWY_DYNAMIC_DISPATCH(mixPlace)(layout_, lookup, features);
}

}  // namespace tessera
#endif

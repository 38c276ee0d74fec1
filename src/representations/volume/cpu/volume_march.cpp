#include "representations/volume/cpu/volume_march.h"

#include <cmath>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "representations/volume/cpu/volume_march.cpp"
#include <hwy/foreach_target.h>
// these must follow foreach_target.h
#include <hwy/contrib/math/math-inl.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace tessera::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// The 8 attributes of a texel, in one or more vectors.
using Tag = hn::CappedTag<float, 8>;
using Vector = hn::Vec<Tag>;
constexpr size_t kLanes = hn::MaxLanes(Tag()), kVectors = 8 / kLanes;

struct Attributes {
  Vector v[kVectors];
};

HWY_ATTR HWY_INLINE Attributes load(const float* from) {
  Attributes result;
  for (size_t i = 0; i < kVectors; ++i) result.v[i] = hn::LoadU(Tag(), from + i * kLanes);
  return result;
}

// The attributes of two texels side by side in a row: 16 consecutive bytes.
using PairTag = hn::CappedTag<float, 16>;
constexpr size_t kPairLanes = hn::MaxLanes(PairTag()), kPairVectors = 16 / kPairLanes;

struct Pair {
  hn::Vec<PairTag> v[kPairVectors];
};

HWY_ATTR HWY_INLINE Pair loadPair(const uint8_t* texel, float weight) {
  const PairTag d;
  const hn::Rebind<int32_t, PairTag> integers;
  const hn::Rebind<uint8_t, PairTag> bytes;
  const auto w = hn::Set(d, weight);
  Pair pair;
  for (size_t i = 0; i < kPairVectors; ++i) {
    pair.v[i] = hn::Mul(w, hn::ConvertTo(d, hn::PromoteTo(integers, hn::LoadU(bytes, texel + i * kPairLanes))));
  }
  return pair;
}

HWY_ATTR HWY_INLINE void addPair(const uint8_t* texel, float weight, Pair& sum) {
  const PairTag d;
  const hn::Rebind<int32_t, PairTag> integers;
  const hn::Rebind<uint8_t, PairTag> bytes;
  const auto w = hn::Set(d, weight);
  for (size_t i = 0; i < kPairVectors; ++i) {
    const auto value = hn::ConvertTo(d, hn::PromoteTo(integers, hn::LoadU(bytes, texel + i * kPairLanes)));
    sum.v[i] = hn::MulAdd(w, value, sum.v[i]);
  }
}

// Weights the first texel of each pair by 1 - fraction and the second by fraction, and sums all four pairs.
HWY_ATTR HWY_INLINE Attributes mix(const Pair pairs[4], const float fractions[4]) {
  Attributes sum;
#if HWY_MAX_BYTES >= 64
  const PairTag d;
  const Tag half;
  const auto first = hn::FirstN(d, 8);
  hn::Vec<PairTag> both = hn::Zero(d);
  for (int i = 0; i < 4; ++i) {
    const auto weight = hn::IfThenElse(first, hn::Set(d, 1 - fractions[i]), hn::Set(d, fractions[i]));
    both = hn::MulAdd(weight, pairs[i].v[0], both);
  }
  sum.v[0] = hn::Add(hn::LowerHalf(half, both), hn::UpperHalf(half, both));
#else
  const Tag d;
  for (size_t k = 0; k < kVectors; ++k) {
    sum.v[k] = hn::Zero(d);
    for (int i = 0; i < 4; ++i) {
      sum.v[k] = hn::MulAdd(hn::Set(d, 1 - fractions[i]), pairs[i].v[k], sum.v[k]);
      sum.v[k] = hn::MulAdd(hn::Set(d, fractions[i]), pairs[i].v[k + kVectors], sum.v[k]);
    }
  }
#endif
  return sum;
}

// Returns 1 - exp(-x), accurate to float precision for small x too.
HWY_ATTR HWY_INLINE float computeOpacity(float x) {
  return x < 0.01f ? x * (1 - x * (0.5f - x * (1.0f / 6))) : 1 - std::exp(-x);
}

// A lookup position along one axis: between texel `index` and the next, at `fraction` of the way.
struct Lookup {
  uint32_t index;
  float fraction;
};

HWY_ATTR HWY_INLINE Lookup planeLookup(float x, uint32_t texels) {
  const float u = std::min(std::max(x - 0.5f, 0.0f), static_cast<float>(texels - 1));
  const uint32_t index = std::min(static_cast<uint32_t>(u), texels - 2);  // so that a next texel exists
  return {index, u - static_cast<float>(index)};
}

struct Marcher {
  const VolumeMarch& march;
  const VolumePart& part = march.part;
  const float voxelsPerTexel = static_cast<float>(part.voxels) / static_cast<float>(part.planes);
  const uint32_t cells = part.planes / VolumePart::kDistanceCell;
  const uint32_t blocks = part.voxels / VolumePart::kMacroblock;
  // A bound on the rounding error of positions: skips stay inside the empty cube by this much.
  const float margin = static_cast<float>(part.planes) * 0x1p-20f;

  // Returns the distance stored for the cell that contains the position, and that cell.
  HWY_ATTR HWY_INLINE uint32_t distanceAt(const float x[3], int32_t cell[3]) const {
    constexpr float kCells = 1.0f / VolumePart::kDistanceCell;
    for (int a = 0; a < 3; ++a) {
      cell[a] = std::min(std::max(static_cast<int32_t>(x[a] * kCells), 0), static_cast<int32_t>(cells) - 1);
    }
    return part.distances[cell[0] + cells * (cell[1] + size_t{cells} * cell[2])];
  }

  // Returns where the ray leaves the cube of cells that are nearer than `distance` to `cell`, in texels along the
  // segment.
  HWY_ATTR HWY_INLINE float exitOfCube(const VolumeSegment& s, const float inverse[3], const int32_t cell[3],
                                       uint32_t distance) const {
    float exit = static_cast<float>(s.length);
    for (int a = 0; a < 3; ++a) {
      const int32_t reach = static_cast<int32_t>(distance), edge = VolumePart::kDistanceCell;
      const float end = inverse[a] > 0 ? static_cast<float>((cell[a] + reach) * edge) - margin
                                       : static_cast<float>((cell[a] - reach + 1) * edge) + margin;
      exit = std::min(exit, (end - s.start[a]) * inverse[a]);
    }
    return exit;
  }

  // Sums the bytes of the 20 texels around the position, weighted. Returns false if the macroblock is not stored.
  HWY_ATTR HWY_INLINE bool sumTexels(const float x[3], Attributes& sum) const {
    float u[3];
    uint32_t block[3];
    for (int a = 0; a < 3; ++a) {
      u[a] = std::min(std::max(x[a] * voxelsPerTexel - 0.5f, 0.0f), static_cast<float>(part.voxels - 1));
      block[a] = static_cast<uint32_t>(u[a]) / VolumePart::kMacroblock;
    }
    const uint32_t stored = part.macroblocks[block[0] + blocks * (block[1] + size_t{blocks} * block[2])];
    if (stored == VolumePart::kEmpty) return false;
    constexpr size_t kRow = VolumePart::kStoredEdge * VolumePart::kAttributes, kSlice = VolumePart::kStoredEdge * kRow;
    const uint8_t* voxel = part.voxelBytes.data() + size_t{stored} * VolumePart::kMacroblockBytes;
    float fraction[3];
    constexpr size_t kStrides[3] = {VolumePart::kAttributes, kRow, kSlice};
    for (int a = 0; a < 3; ++a) {
      const uint32_t index = static_cast<uint32_t>(u[a]);
      fraction[a] = u[a] - static_cast<float>(index);
      voxel += (index - VolumePart::kMacroblock * block[a]) * kStrides[a];
    }
    // Pairs of texels are interpolated across the rows first, then along the rows.
    const float y = fraction[1], z = fraction[2];
    Pair pairs[4];
    float fractions[4] = {fraction[0]};
    pairs[0] = loadPair(voxel, (1 - y) * (1 - z));
    addPair(voxel + kRow, y * (1 - z), pairs[0]);
    addPair(voxel + kSlice, (1 - y) * z, pairs[0]);
    addPair(voxel + kSlice + kRow, y * z, pairs[0]);
    Lookup at[3];
    for (int a = 0; a < 3; ++a) at[a] = planeLookup(x[a], part.planes);
    const size_t row = size_t{part.planes} * VolumePart::kAttributes;
    for (int a = 0; a < 3; ++a) {
      const int b = a == 0 ? 1 : 0, c = a == 2 ? 1 : 2;
      const uint8_t* texel = part.planeBytes[a].data() + at[c].index * row + at[b].index * VolumePart::kAttributes;
      pairs[a + 1] = loadPair(texel, 1 - at[c].fraction);
      addPair(texel + row, at[c].fraction, pairs[a + 1]);
      fractions[a + 1] = at[b].fraction;
    }
    sum = mix(pairs, fractions);
    return true;
  }
};

HWY_ATTR void marchVolume(const VolumeMarch& march, ContentComposite& composite, MarchCounts& counts) {
  const Tag d;
  const Marcher marcher{march};
  // Maps a sum of bytes over the four sources to the exponent of exp(sum - 1) for the density, which comes first, and
  // of sigmoid(sum) = 1 / (1 + exp(-sum)) for the other attributes.
  alignas(64) float factors[8], terms[8], maximum[8], values[8] = {};
  for (int i = 0; i < 8; ++i) {
    const float range = i == 0 ? march.content.densityRange : march.content.featureRange, sign = i == 0 ? 1.0f : -1.0f;
    factors[i] = sign * 2 * range / 255;
    terms[i] = sign * -4 * range - (i == 0 ? 1.0f : 0.0f);
    maximum[i] = i == 0 ? 15.0f : 80.0f;
    if (i > 0) values[i] = composite.values[i - 1];
  }
  const Attributes factor = load(factors), term = load(terms), limit = load(maximum);
  const auto one = hn::Set(d, 1.0f);
  Attributes total = load(values);
  float transmittance = composite.transmittance, depth = composite.depth;
  const float perTexel = static_cast<float>(march.content.stepsPerTexel), stepLength = 1 / perTexel;  // in texels
  uint64_t steps = 0, samples = 0;
  bool seen = transmittance * march.transmittanceBefore >= march.settings.minTransmittance;
  for (int number = 0; number < march.path.count && seen; ++number) {
    const VolumeSegment& s = march.path.segments[number];
    float inverse[3];
    for (int a = 0; a < 3; ++a)
      inverse[a] = std::copysign(1 / std::max(std::abs(s.direction[a]), 1e-20f), s.direction[a]);
    const uint32_t count = static_cast<uint32_t>(std::ceil(s.length * perTexel));
    for (uint32_t i = 0; i < count;) {
      ++steps;
      const float from = static_cast<float>(i) * stepLength;
      const double to = std::min(static_cast<double>(from + stepLength), s.length);
      const float tau = 0.5f * (from + static_cast<float>(to));
      const float x[3] = {s.start[0] + tau * s.direction[0], s.start[1] + tau * s.direction[1],
                          s.start[2] + tau * s.direction[2]};
      int32_t cell[3];
      if (const uint32_t distance = marcher.distanceAt(x, cell); distance > 0) {
        ++i;
        if (march.settings.skipEmptySpace) {
          // The first step whose middle lies at the exit or behind it.
          const float next = std::ceil(marcher.exitOfCube(s, inverse, cell, distance) * perTexel - 0.5f);
          if (next > static_cast<float>(i)) i = static_cast<uint32_t>(next);
        }
        continue;
      }
      const uint32_t step = i++;
      Attributes exponent;
      if (!marcher.sumTexels(x, exponent)) continue;
      ++samples;
      for (size_t k = 0; k < kVectors; ++k) {
        exponent.v[k] = hn::Min(hn::MulAdd(exponent.v[k], factor.v[k], term.v[k]), limit.v[k]);
        exponent.v[k] = hn::Exp(d, exponent.v[k]);
      }
      const bool straight = s.growth == 0;
      const double length = straight ? (to - from) * s.square / s.rate : s.distanceBetween(from, to);
      const float opacity = computeOpacity(hn::GetLane(exponent.v[0]) * static_cast<float>(length));
      const float distance = static_cast<float>(s.distanceAt(tau));
      if (march.trace != nullptr) march.trace->push_back({number, step, opacity, distance});
      const float weight = transmittance * opacity;
      if (weight < 1e-9f) continue;  // far below the precision of a sum of floats near 1
      const auto w = hn::Set(d, weight);
      for (size_t k = 0; k < kVectors; ++k) {
        total.v[k] = hn::MulAdd(w, hn::Div(one, hn::Add(one, exponent.v[k])), total.v[k]);
      }
      depth += weight * distance;
      transmittance *= 1 - opacity;
      if (transmittance * march.transmittanceBefore < march.settings.minTransmittance) {
        seen = false;
        break;
      }
    }
  }
  for (size_t k = 0; k < kVectors; ++k) hn::StoreU(total.v[k], d, values + k * kLanes);
  for (int i = 0; i < ContentComposite::kValues; ++i) composite.values[i] = values[i + 1];
  composite.transmittance = transmittance;
  composite.depth = depth;
  counts.steps += steps;
  counts.samples += samples;
}

}  // namespace tessera::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace tessera {

HWY_EXPORT(marchVolume);

void VolumeMarch::run(ContentComposite& composite, MarchCounts& counts) const {
  HWY_DYNAMIC_DISPATCH(marchVolume)(*this, composite, counts);
}

}  // namespace tessera
#endif

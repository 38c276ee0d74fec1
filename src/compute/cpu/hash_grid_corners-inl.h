// The corners of grid cells around samples: their indices in the table of a level, and their weights. Part of
// hash_grid.cpp, which includes it once for each SIMD target.
#if defined(TESSERA_COMPUTE_CPU_HASH_GRID_CORNERS_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef TESSERA_COMPUTE_CPU_HASH_GRID_CORNERS_INL_H_
#undef TESSERA_COMPUTE_CPU_HASH_GRID_CORNERS_INL_H_
#else
#define TESSERA_COMPUTE_CPU_HASH_GRID_CORNERS_INL_H_
#endif

#include <hwy/highway.h>

#include "compute/cpu/hash_grid_corners.h"
#include "compute/hash_grid.h"

HWY_BEFORE_NAMESPACE();
namespace tessera::cpu::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using Float = hn::CappedTag<float, 16>;
using Vector = hn::Vec<Float>;
using Word = hn::RebindToUnsigned<Float>;

HWY_INLINE void cellsOfGroup(const HashGridLevel& level, const float* positions, Corners& corners) {
  const Float d;
  const hn::RebindToSigned<Float> di;
  const Word du;
  const Vector scale = hn::Set(d, level.scale), half = hn::Set(d, 0.5f);
  for (int s = 0; s < kGroup; s += static_cast<int>(hn::Lanes(d))) {
    Vector x, y, z;
    hn::LoadInterleaved3(d, positions + 3 * s, x, y, z);
    const Vector at[3] = {hn::MulAdd(x, scale, half), hn::MulAdd(y, scale, half), hn::MulAdd(z, scale, half)};
    for (int axis = 0; axis < 3; ++axis) {
      const auto cell = hn::ConvertTo(di, at[axis]);  // positions are not negative: truncation is floor
      hn::Store(hn::BitCast(du, cell), du, corners.cell[axis] + s);
      hn::Store(hn::Sub(at[axis], hn::ConvertTo(d, cell)), d, corners.fraction[axis] + s);
    }
  }
}

template <bool kHashed>
HWY_INLINE void indicesOfGroup(const HashGridLevel& level, Corners& corners) {
  const Word du;
  const auto entries = hn::Set(du, level.entries), mask = hn::Set(du, level.entries - 1);
  const auto primeY = hn::Set(du, kHashed ? 2654435761u : level.resolution);
  const auto primeZ = hn::Set(du, kHashed ? 805459861u : level.resolution * level.resolution);
  for (int s = 0; s < kGroup; s += static_cast<int>(hn::Lanes(du))) {
    const auto x0 = hn::Load(du, corners.cell[0] + s);
    const auto y0 = hn::Mul(hn::Load(du, corners.cell[1] + s), primeY);
    const auto z0 = hn::Mul(hn::Load(du, corners.cell[2] + s), primeZ);
    const auto x1 = hn::Add(x0, hn::Set(du, 1u)), y1 = hn::Add(y0, primeY), z1 = hn::Add(z0, primeZ);
    for (int c = 0; c < 8; ++c) {
      const auto x = c & 1 ? x1 : x0, y = c & 2 ? y1 : y0, z = c & 4 ? z1 : z0;
      if constexpr (kHashed) {
        hn::Store(hn::And(hn::Xor(x, hn::Xor(y, z)), mask), du, corners.index[c] + s);
      } else {
        // x + r (y + r z) < 2 · entries: one subtraction is the modulo.
        const auto i = hn::Add(x, hn::Add(y, z));
        hn::Store(hn::IfThenElse(hn::Lt(i, entries), i, hn::Sub(i, entries)), du, corners.index[c] + s);
      }
    }
  }
}

HWY_INLINE void weightsOfGroup(Corners& corners) {
  const Float d;
  const Vector one = hn::Set(d, 1.0f);
  for (int s = 0; s < kGroup; s += static_cast<int>(hn::Lanes(d))) {
    const Vector x1 = hn::Load(d, corners.fraction[0] + s), x0 = hn::Sub(one, x1);
    const Vector y1 = hn::Load(d, corners.fraction[1] + s), y0 = hn::Sub(one, y1);
    const Vector z1 = hn::Load(d, corners.fraction[2] + s), z0 = hn::Sub(one, z1);
    const Vector xy[4] = {hn::Mul(x0, y0), hn::Mul(x1, y0), hn::Mul(x0, y1), hn::Mul(x1, y1)};
    for (int c = 0; c < 8; ++c) hn::Store(hn::Mul(xy[c & 3], c & 4 ? z1 : z0), d, corners.weight[c] + s);
  }
}

HWY_INLINE void cornersOfGroup(const HashGridLevel& level, const float* positions, Corners& corners) {
  cellsOfGroup(level, positions, corners);
  if (level.hashed) {
    indicesOfGroup<true>(level, corners);
  } else {
    indicesOfGroup<false>(level, corners);
  }
}

}  // namespace tessera::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif

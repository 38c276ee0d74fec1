// The vertices around a cell relative to a ray, and the edges between them. Part of trace_octahedra.cpp, which includes
// it once for each SIMD target.
#if defined(TESSERA_COMPUTE_CPU_OCTAHEDRA_VERTICES_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef TESSERA_COMPUTE_CPU_OCTAHEDRA_VERTICES_INL_H_
#undef TESSERA_COMPUTE_CPU_OCTAHEDRA_VERTICES_INL_H_
#else
#define TESSERA_COMPUTE_CPU_OCTAHEDRA_VERTICES_INL_H_
#endif

#include <hwy/highway.h>

#include <cstring>

#include "compute/cpu/octahedra_cells.h"

HWY_BEFORE_NAMESPACE();
namespace tessera::cpu::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using Float = hn::CappedTag<float, 16>;
using Floats = hn::Vec<Float>;
using Int = hn::RebindToSigned<Float>;
using Ints = hn::Vec<Int>;

// A table of kSlots numbers.
struct Table {
#if HWY_TARGET == HWY_AVX3
  Floats low, high;

  // Highway 1.0 has no lookup in two vectors.
  HWY_INLINE Floats lookup(Ints slots) const {
    return Floats{_mm512_permutex2var_ps(low.raw, slots.raw, high.raw)};
  }
#else
  alignas(64) float values[kSlots];

  HWY_INLINE Floats lookup(Ints slots) const {
    alignas(64) int32_t each[16];
    alignas(64) float gathered[16];
    hn::Store(slots, Int(), each);
    for (size_t i = 0; i < hn::Lanes(Int()); ++i) gathered[i] = values[each[i] & (kSlots - 1)];
    return hn::Load(Float(), gathered);
  }
#endif
};

// The vertices of the 27 cells around one, relative to its centre.
struct VerticesAround {
  uint32_t cell = 0xffffffffu;  // in all grids
  alignas(64) float at[3][kSlots];

  // `rows`: the displacements of the three cells along x, in the order of y, then z.
  HWY_INLINE void set(const float* const rows[9]) {
    const Float d;
#if HWY_TARGET == HWY_AVX3
    Floats all[2][3];
    deinterleave(rows, all);
#else
    alignas(64) float around[3 * kSlots] = {};
    for (int row = 0; row < 6; ++row) std::memcpy(around + (row < 3 ? 0 : 48 - 27) + 9 * row, rows[row], 36);
    std::memcpy(around + 27, rows[6], 36);
    std::memcpy(around + 36, rows[7], 36);
    std::memcpy(around + 45, rows[8], 12);
    std::memcpy(around + 75, rows[8] + 3, 24);
#endif
    for (int first = 0; first < kSlots; first += static_cast<int>(hn::Lanes(d))) {
      Floats displacements[3];
#if HWY_TARGET == HWY_AVX3
      for (int axis = 0; axis < 3; ++axis) displacements[axis] = all[first / 16][axis];
#else
      hn::LoadInterleaved3(d, around + 3 * first, displacements[0], displacements[1], displacements[2]);
#endif
      for (int axis = 0; axis < 3; ++axis)
        hn::Store(hn::Add(hn::Load(d, kSlotOffsets.at[axis] + first), displacements[axis]), d, at[axis] + first);
    }
  }

#if HWY_TARGET == HWY_AVX3
 private:
  // Coordinates by vector of slots and axis.
  static HWY_INLINE void deinterleave(const float* const rows[9], Floats all[2][3]) {
    // The 27 numbers of three rows fill one vector, and 11 lanes of another.
    __m512 from[3][2];
    for (int z = 0; z < 3; ++z) {
      const float* const* const row = rows + 3 * z;
      from[z][0] = _mm512_mask_loadu_ps(_mm512_maskz_loadu_ps(0x01ff, row[0]), 0xfe00, row[1] - 9);
      from[z][1] = _mm512_mask_loadu_ps(_mm512_maskz_loadu_ps(0x0003, row[1] + 7), 0x07fc, row[2] - 2);
    }
    const __m512i three =
        _mm512_setr_epi32(0, 3, 6, 9, 12, 15, 18, 21, 24, 0, 3, 6, 9, 12, 15, 18);  // also from lane 9 on
    const __m512i rest = _mm512_setr_epi32(0, 0, 0, 0, 0, 0, 0, 0, 0, 21, 24, 0, 0, 0, 0, 0);
    for (int axis = 0; axis < 3; ++axis) {
      const __m512i add = _mm512_set1_epi32(axis);
      const __m512i index = _mm512_add_epi32(three, add), restIndex = _mm512_add_epi32(rest, add);
      all[0][axis] = Floats{_mm512_mask_mov_ps(_mm512_permutex2var_ps(from[0][0], index, from[0][1]), 0xfe00,
                                               _mm512_permutex2var_ps(from[2][0], index, from[2][1]))};
      all[1][axis] = Floats{_mm512_mask_mov_ps(_mm512_permutex2var_ps(from[1][0], index, from[1][1]), 0xfe00,
                                               _mm512_permutex2var_ps(from[2][0], restIndex, from[2][1]))};
    }
  }
#endif
};

// Those of the last cells that rays crossed, as neighbouring rays cross the same ones.
class RecentVertices {
 public:
  HWY_INLINE VerticesAround& place(const int cell[3]) {
    return entries_[static_cast<uint32_t>(cell[0] + 5 * cell[1] + 19 * cell[2]) % kEntries];
  }

 private:
  static constexpr uint32_t kEntries = 64;
  VerticesAround entries_[kEntries];
};

// Vertices relative to a ray, sheared so that the ray is the z axis.
class ShearedVertices {
 public:
  // `origin`: a point of the ray relative to the centre of the middle cell; `shear`: its step along x and y for
  // one along z; `sign`: of its step along z.
  HWY_INLINE void set(const VerticesAround& vertices, const float origin[3], const float shear[2], float sign, int z) {
    const int x = z == 2 ? 0 : z + 1, y = z == 0 ? 2 : z - 1;
    const Float d;
    const Floats shearX = hn::Set(d, shear[0]), shearY = hn::Set(d, shear[1]), signs = hn::Set(d, sign);
    for (int first = 0, part = 0; first < kSlots; first += static_cast<int>(hn::Lanes(d)), ++part) {
      const auto at = [&](int axis) HWY_ATTR {
        return hn::Sub(hn::Load(d, vertices.at[axis] + first), hn::Set(d, origin[axis]));
      };
      const Floats atX = at(x), atY = at(y), atZ = at(z);
      put(tables[0], part, first, hn::NegMulAdd(shearX, atZ, atX));
      put(tables[1], part, first, hn::NegMulAdd(shearY, atZ, atY));
      put(tables[2], part, first, hn::Mul(atZ, signs));
    }
  }

  Table tables[3];

 private:
  static HWY_INLINE void put(Table& table, [[maybe_unused]] int part, [[maybe_unused]] int first, Floats values) {
#if HWY_TARGET == HWY_AVX3
    (part == 0 ? table.low : table.high) = values;
#else
    hn::Store(values, Float(), table.values + first);
#endif
  }
};

// Twice the signed areas of the ray with each edge: the barycentric coordinates of the opposite vertices.
struct EdgeAreas {
  Floats u, v, w;

  HWY_INLINE EdgeAreas(const ShearedVertices& vertices, Ints a, Ints b, Ints c) {
    const Table &x = vertices.tables[0], &y = vertices.tables[1];
    const Floats ax = x.lookup(a), ay = y.lookup(a), bx = x.lookup(b), by = y.lookup(b), cx = x.lookup(c),
                 cy = y.lookup(c);
    u = hn::MulSub(bx, cy, hn::Mul(by, cx));
    v = hn::MulSub(cx, ay, hn::Mul(cy, ax));
    w = hn::MulSub(ax, by, hn::Mul(ay, bx));
  }
};

}  // namespace tessera::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // per target

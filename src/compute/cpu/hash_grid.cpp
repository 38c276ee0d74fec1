// The hash grid on the CPU. The forward pass proceeds level by level, so that the table of one level stays in the
// second-level cache; indices and weights are computed in vectors, and the table is read by independent scalar loads.
// The backward pass assigns each level (with many threads, each part of its table) to one task that processes all
// samples in order: it needs no atomics, and sums are the same for any number of threads. Samples of a ray that share a
// cell are summed in registers.

#include "compute/hash_grid.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "compute/cpu/kernels.h"
#include "compute/host_memory.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "compute/cpu/hash_grid.cpp"
#include <hwy/foreach_target.h>
// after foreach_target
#include <hwy/cache_control.h>
#include <hwy/highway.h>

#include "compute/cpu/hash_grid_corners-inl.h"

#ifndef TESSERA_CPU_HASH_GRID_ONCE
#define TESSERA_CPU_HASH_GRID_ONCE
namespace tessera::cpu {

inline constexpr uint32_t kEntriesOfFirstCache = 4096;  // entries of two features that fit into 32 KiB

struct TableRange {
  uint32_t begin, end;  // entries of the level that a task may add to
};

}  // namespace tessera::cpu
#endif

HWY_BEFORE_NAMESPACE();
namespace tessera::cpu::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// Entries of two features: 8 bytes, loaded as one word. All words of the group are loaded before the first is used.
HWY_INLINE void mixPairs(const float* HWY_RESTRICT table, const Corners& corners, float* HWY_RESTRICT out) {
  const Float d;
  alignas(64) float values[8][2 * kGroup];
  for (int c = 0; c < 8; ++c) {
    for (int s = 0; s < kGroup; ++s) std::memcpy(&values[c][2 * s], table + 2 * size_t{corners.index[c][s]}, 8);
  }
  for (int s = 0; s < kGroup; s += static_cast<int>(hn::Lanes(d))) {
    Vector sum0 = hn::Zero(d), sum1 = hn::Zero(d);
    for (int c = 0; c < 8; ++c) {
      const Vector w = hn::Load(d, corners.weight[c] + s);
      Vector f0, f1;
      hn::LoadInterleaved2(d, values[c] + 2 * s, f0, f1);
      sum0 = hn::MulAdd(w, f0, sum0);
      sum1 = hn::MulAdd(w, f1, sum1);
    }
    hn::StoreInterleaved2(sum0, sum1, d, out + 2 * s);
  }
}

// Entries of four or eight features: at most 32 bytes, in one or a few vectors.
template <size_t kFeatures>
HWY_INLINE void mixWide(const float* HWY_RESTRICT table, const Corners& corners, float* HWY_RESTRICT out) {
  const hn::CappedTag<float, kFeatures> d;
  constexpr size_t kLanes = hn::MaxLanes(decltype(d)()), kVectors = kFeatures / kLanes;
  for (int c = 0; c < 8; ++c) {
    for (int s = 0; s < kGroup; ++s) hwy::Prefetch(table + kFeatures * corners.index[c][s]);
  }
  for (int s = 0; s < kGroup; ++s) {
    hn::Vec<decltype(d)> sum[kVectors];
    for (size_t v = 0; v < kVectors; ++v) sum[v] = hn::Zero(d);
    for (int c = 0; c < 8; ++c) {
      const auto w = hn::Set(d, corners.weight[c][s]);
      const float* entry = table + kFeatures * corners.index[c][s];
      for (size_t v = 0; v < kVectors; ++v) sum[v] = hn::MulAdd(w, hn::LoadU(d, entry + v * kLanes), sum[v]);
    }
    for (size_t v = 0; v < kVectors; ++v) hn::StoreU(sum[v], d, out + kFeatures * s + v * kLanes);
  }
}

void mixAny(const float* table, const Corners& corners, int features, float* out) {
  for (int s = 0; s < kGroup; ++s) {
    for (int f = 0; f < features; ++f) {
      float sum = 0;
      for (int c = 0; c < 8; ++c) sum += corners.weight[c][s] * table[size_t{corners.index[c][s]} * features + f];
      out[s * features + f] = sum;
    }
  }
}

// The positions [first, first + kGroup); the last group of a batch is padded with zeros.
HWY_INLINE const float* groupPositions(const float* positions, size_t first, size_t n, float* padded) {
  if (first + kGroup <= n) return positions + 3 * first;
  std::memset(padded, 0, sizeof(float) * 3 * kGroup);
  std::memcpy(padded, positions + 3 * first, sizeof(float) * 3 * (n - first));
  return padded;
}

void forwardRange(const HashGridForward& a, size_t l, size_t begin, size_t end) {
  const HashGridLevel& level = a.grid.levels[l];
  const int features = a.grid.features;
  const float* table = hostPointer(a.table) + level.firstEntry * features;
  const float* positions = hostPointer(a.positions);
  float* out = hostPointer(a.encoded.data) + l * a.encoded.groupStride;
  Corners corners;
  alignas(64) float padded[3 * kGroup];
  alignas(64) float tail[8 * kGroup];
  for (size_t first = begin; first < end; first += kGroup) {
    cornersOfGroup(level, groupPositions(positions, first, end, padded), corners);
    weightsOfGroup(corners);
    const size_t rows = std::min<size_t>(kGroup, end - first);
    float* to = rows == kGroup ? out + first * features : tail;
    if (features == 2) {
      mixPairs(table, corners, to);
    } else if (features == 4) {
      mixWide<4>(table, corners, to);
    } else if (features == 8) {
      mixWide<8>(table, corners, to);
    } else {
      mixAny(table, corners, features, to);
    }
    if (to == tail) std::memcpy(out + first * features, tail, sizeof(float) * rows * features);
  }
}

// Vectors for the eight corner gradients of one cell, [corner][feature].
using Lanes16 = hn::CappedTag<float, 16>;

// Patterns over [corner][feature] of two features: 1 where the corner is the upper neighbour of its axis.
alignas(64) constexpr float kUpper[3][16] = {{0, 0, 1, 1, 0, 0, 1, 1, 0, 0, 1, 1, 0, 0, 1, 1},
                                             {0, 0, 0, 0, 1, 1, 1, 1, 0, 0, 0, 0, 1, 1, 1, 1},
                                             {0, 0, 0, 0, 0, 0, 0, 0, 1, 1, 1, 1, 1, 1, 1, 1}};

HWY_INLINE bool sameCell(const Corners& corners, int s, int t) {
  return ((corners.cell[0][s] ^ corners.cell[0][t]) | (corners.cell[1][s] ^ corners.cell[1][t]) |
          (corners.cell[2][s] ^ corners.cell[2][t])) == 0;
}

// Adds the corner gradients of sample s's cell to the table.
template <bool kWhole>
HWY_INLINE void flushCell(float* HWY_RESTRICT table, const Corners& corners, int s, const float* HWY_RESTRICT sum,
                          TableRange range) {
  const hn::FixedTag<float, 2> pair;
  if constexpr (kWhole) {
    // Neighbours in x are never the same entry, so two corners can be added at once.
    const hn::FixedTag<float, 4> four;
    for (int c = 0; c < 8; c += 2) {
      float* low = table + 2 * size_t{corners.index[c][s]};
      float* high = table + 2 * size_t{corners.index[c + 1][s]};
      const auto both =
          hn::Add(hn::Combine(four, hn::Load(pair, high), hn::Load(pair, low)), hn::Load(four, sum + 2 * c));
      hn::Store(hn::LowerHalf(pair, both), pair, low);
      hn::Store(hn::UpperHalf(pair, both), pair, high);
    }
    return;
  }
  for (int c = 0; c < 8; ++c) {
    const uint32_t index = corners.index[c][s];
    if (index < range.begin || index >= range.end) continue;
    float* to = table + 2 * size_t{index};
    hn::Store(hn::Add(hn::Load(pair, to), hn::Load(pair, sum + 2 * c)), pair, to);
  }
}

template <bool kWhole>
void backwardPairs(const HashGridBackward& a, const HashGridLevel& level, const float* gradients, float* table,
                   HostRows samples, TableRange range) {
  const Lanes16 d;
  constexpr int kLanes = static_cast<int>(hn::MaxLanes(Lanes16()));
  constexpr int kVectors = 16 / kLanes;
  const float* positions = hostPointer(a.positions);
  Corners corners;
  alignas(64) float padded[3 * kGroup];
  hn::Vec<Lanes16> total[kVectors], sign[3][kVectors], base[3][kVectors];
  for (int v = 0; v < kVectors; ++v) {
    for (int axis = 0; axis < 3; ++axis) {  // weight along an axis = base + sign · fraction
      const auto upper = hn::Load(d, kUpper[axis] + v * kLanes);
      sign[axis][v] = hn::Sub(hn::Add(upper, upper), hn::Set(d, 1.0f));
      base[axis][v] = hn::Sub(hn::Set(d, 1.0f), upper);
    }
  }
  const size_t end = samples.end;
  for (size_t first = samples.begin; first < end; first += kGroup) {
    cornersOfGroup(level, groupPositions(positions, first, end, padded), corners);
    const int rows = static_cast<int>(std::min<size_t>(kGroup, end - first));
    if (kWhole && level.entries > kEntriesOfFirstCache) {
      for (int c = 0; c < 8; c += 2) {  // the neighbour in x is usually in the same cache line
        for (int s = 0; s < kGroup; ++s) hwy::Prefetch(table + 2 * size_t{corners.index[c][s]});
      }
    }
    int cellSample = -1;  // the sample whose cell `total` belongs to
    const auto flush = [&] {
      alignas(64) float sum[16];
      for (int v = 0; v < kVectors; ++v) hn::Store(total[v], d, sum + v * kLanes);
      flushCell<kWhole>(table, corners, cellSample, sum, range);
    };
    for (int s = 0; s < rows; ++s) {
      uint64_t word;
      std::memcpy(&word, gradients + 2 * (first + s), 8);
      if ((word & 0x7fffffff7fffffffull) == 0) continue;  // zero gradients, as for samples behind a surface
      if (cellSample < 0 || !sameCell(corners, cellSample, s)) {
        if (cellSample >= 0) flush();
        cellSample = s;
        for (int v = 0; v < kVectors; ++v) total[v] = hn::Zero(d);
      }
      const auto g = hn::BitCast(d, hn::Set(hn::Repartition<uint64_t, Lanes16>(), word));
      const auto fx = hn::Set(d, corners.fraction[0][s]), fy = hn::Set(d, corners.fraction[1][s]),
                 fz = hn::Set(d, corners.fraction[2][s]);
      for (int v = 0; v < kVectors; ++v) {
        const auto wx = hn::MulAdd(sign[0][v], fx, base[0][v]), wy = hn::MulAdd(sign[1][v], fy, base[1][v]),
                   wz = hn::MulAdd(sign[2][v], fz, base[2][v]);
        total[v] = hn::MulAdd(hn::Mul(hn::Mul(wx, wy), wz), g, total[v]);
      }
    }
    if (cellSample >= 0) flush();
  }
}

template <size_t kFeatures>
void backwardWide(const HashGridBackward& a, const HashGridLevel& level, const float* gradients, float* table,
                  HostRows samples, TableRange range) {
  const hn::CappedTag<float, kFeatures> d;
  constexpr size_t kLanes = hn::MaxLanes(decltype(d)()), kVectors = kFeatures / kLanes;
  const float* positions = hostPointer(a.positions);
  Corners corners;
  alignas(64) float padded[3 * kGroup];
  const size_t end = samples.end;
  for (size_t first = samples.begin; first < end; first += kGroup) {
    cornersOfGroup(level, groupPositions(positions, first, end, padded), corners);
    weightsOfGroup(corners);
    for (int c = 0; c < 8; ++c) {
      for (int s = 0; s < kGroup; ++s) hwy::Prefetch(table + kFeatures * corners.index[c][s]);
    }
    const int rows = static_cast<int>(std::min<size_t>(kGroup, end - first));
    for (int s = 0; s < rows; ++s) {
      hn::Vec<decltype(d)> g[kVectors];
      bool any = false;  // any gradient is not zero; all are zero for samples behind a surface
      for (size_t v = 0; v < kVectors; ++v) {
        g[v] = hn::LoadU(d, gradients + kFeatures * (first + s) + v * kLanes);
        any |= !hn::AllTrue(d, hn::Eq(g[v], hn::Zero(d)));
      }
      if (!any) continue;
      for (int c = 0; c < 8; ++c) {
        const uint32_t index = corners.index[c][s];
        if (index < range.begin || index >= range.end) continue;
        const auto w = hn::Set(d, corners.weight[c][s]);
        float* entry = table + kFeatures * index;
        for (size_t v = 0; v < kVectors; ++v, entry += kLanes) {
          hn::StoreU(hn::MulAdd(w, g[v], hn::LoadU(d, entry)), d, entry);
        }
      }
    }
  }
}

void backwardAny(const HashGridBackward& a, const HashGridLevel& level, const float* gradients, float* table,
                 HostRows samples, TableRange range) {
  const int features = a.grid.features;
  const float* positions = hostPointer(a.positions);
  Corners corners;
  alignas(64) float padded[3 * kGroup];
  const size_t end = samples.end;
  for (size_t first = samples.begin; first < end; first += kGroup) {
    cornersOfGroup(level, groupPositions(positions, first, end, padded), corners);
    weightsOfGroup(corners);
    const int rows = static_cast<int>(std::min<size_t>(kGroup, end - first));
    for (int s = 0; s < rows; ++s) {
      for (int c = 0; c < 8; ++c) {
        const uint32_t index = corners.index[c][s];
        if (index < range.begin || index >= range.end) continue;
        for (int f = 0; f < features; ++f) {
          table[size_t{index} * features + f] += corners.weight[c][s] * gradients[(first + s) * features + f];
        }
      }
    }
  }
}

void backwardLevel(const HashGridBackward& a, size_t l, HostRows samples, TableRange range) {
  const HashGridLevel& level = a.grid.levels[l];
  const float* gradients = hostPointer(a.encodedGradients.data) + l * a.encodedGradients.groupStride;
  float* table = hostPointer(a.tableGradients) + level.firstEntry * a.grid.features;
  if (a.grid.features == 4) {
    backwardWide<4>(a, level, gradients, table, samples, range);
  } else if (a.grid.features == 8) {
    backwardWide<8>(a, level, gradients, table, samples, range);
  } else if (a.grid.features != 2) {
    backwardAny(a, level, gradients, table, samples, range);
  } else if (range.begin == 0 && range.end >= level.entries) {
    backwardPairs<true>(a, level, gradients, table, samples, range);
  } else {
    backwardPairs<false>(a, level, gradients, table, samples, range);
  }
}

// The products of the upstream gradients with the entries, [corner][sample]. gradients: [kGroup][features].
using Products = float[8][kGroup];

HWY_INLINE void multiplyPairs(const float* HWY_RESTRICT table, const Corners& corners,
                              const float* HWY_RESTRICT gradients, Products& products) {
  const Float d;
  alignas(64) float values[8][2 * kGroup];
  for (int c = 0; c < 8; ++c) {
    for (int s = 0; s < kGroup; ++s) std::memcpy(&values[c][2 * s], table + 2 * size_t{corners.index[c][s]}, 8);
  }
  for (int s = 0; s < kGroup; s += static_cast<int>(hn::Lanes(d))) {
    Vector g0, g1;
    hn::LoadInterleaved2(d, gradients + 2 * s, g0, g1);
    for (int c = 0; c < 8; ++c) {
      Vector f0, f1;
      hn::LoadInterleaved2(d, values[c] + 2 * s, f0, f1);
      hn::Store(hn::MulAdd(g0, f0, hn::Mul(g1, f1)), d, products[c] + s);
    }
  }
}

void multiplyAny(const float* table, const Corners& corners, const float* gradients, int features, Products& products) {
  for (int c = 0; c < 8; ++c) {
    for (int s = 0; s < kGroup; ++s) {
      products[c][s] = 0;
      for (int f = 0; f < features; ++f)
        products[c][s] += gradients[s * features + f] * table[size_t{corners.index[c][s]} * features + f];
    }
  }
}

// d value / d x_axis = scale · Σ over the corners of the face of weight⊥ · (upper - lower entry). Adds to
// positionGradients, [kGroup][3].
HWY_INLINE void addPositionGradients(float levelScale, const Corners& corners, const Products& products,
                                     float* HWY_RESTRICT positionGradients) {
  const Float d;
  const Vector scale = hn::Set(d, levelScale);
  const auto mix = [](Vector low, Vector high, Vector t) HWY_ATTR { return hn::MulAdd(t, hn::Sub(high, low), low); };
  for (int s = 0; s < kGroup; s += static_cast<int>(hn::Lanes(d))) {
    Vector dot[8];
    for (int c = 0; c < 8; ++c) dot[c] = hn::Load(d, products[c] + s);
    const Vector x = hn::Load(d, corners.fraction[0] + s), y = hn::Load(d, corners.fraction[1] + s),
                 z = hn::Load(d, corners.fraction[2] + s);
    const Vector alongX = mix(mix(hn::Sub(dot[1], dot[0]), hn::Sub(dot[3], dot[2]), y),
                              mix(hn::Sub(dot[5], dot[4]), hn::Sub(dot[7], dot[6]), y), z);
    const Vector alongY = mix(mix(hn::Sub(dot[2], dot[0]), hn::Sub(dot[3], dot[1]), x),
                              mix(hn::Sub(dot[6], dot[4]), hn::Sub(dot[7], dot[5]), x), z);
    const Vector alongZ = mix(mix(hn::Sub(dot[4], dot[0]), hn::Sub(dot[5], dot[1]), x),
                              mix(hn::Sub(dot[6], dot[2]), hn::Sub(dot[7], dot[3]), x), y);
    Vector sumX, sumY, sumZ;
    hn::LoadInterleaved3(d, positionGradients + 3 * s, sumX, sumY, sumZ);
    hn::StoreInterleaved3(hn::MulAdd(scale, alongX, sumX), hn::MulAdd(scale, alongY, sumY),
                          hn::MulAdd(scale, alongZ, sumZ), d, positionGradients + 3 * s);
  }
}

void backwardPositions(const HashGridBackward& a, size_t begin, size_t end) {
  constexpr size_t kMaxFeatures = 8;
  const int features = a.grid.features;
  const float* positions = hostPointer(a.positions);
  float* out = hostPointer(a.positionGradients);
  Corners corners;
  alignas(64) float padded[3 * kGroup], paddedGradients[kMaxFeatures * kGroup] = {}, tail[3 * kGroup];
  alignas(64) Products products;
  std::memset(out + 3 * begin, 0, sizeof(float) * 3 * (end - begin));
  for (size_t l = 0; l < a.grid.levels.size(); ++l) {
    const HashGridLevel& level = a.grid.levels[l];
    const float* table = hostPointer(a.table) + level.firstEntry * features;
    const float* gradients = hostPointer(a.encodedGradients.data) + l * a.encodedGradients.groupStride;
    for (size_t first = begin; first < end; first += kGroup) {
      cornersOfGroup(level, groupPositions(positions, first, end, padded), corners);
      const size_t rows = std::min<size_t>(kGroup, end - first);
      const float* upstream = gradients + first * features;
      if (rows < kGroup) {
        std::memcpy(paddedGradients, upstream, sizeof(float) * rows * features);
        upstream = paddedGradients;
      }
      if (features == 2) {
        multiplyPairs(table, corners, upstream, products);
      } else {
        multiplyAny(table, corners, upstream, features, products);
      }
      if (rows == kGroup) {
        addPositionGradients(level.scale, corners, products, out + 3 * first);
        continue;
      }
      std::memset(tail, 0, sizeof(tail));
      std::memcpy(tail, out + 3 * first, sizeof(float) * 3 * rows);
      addPositionGradients(level.scale, corners, products, tail);
      std::memcpy(out + 3 * first, tail, sizeof(float) * 3 * rows);
    }
  }
}

}  // namespace tessera::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace tessera::cpu {

HWY_EXPORT(forwardRange);
HWY_EXPORT(backwardLevel);
HWY_EXPORT(backwardPositions);

void run(Context& context, const HashGridForward& a) {
  const HostRows rows = hostRows(a.samples);
  const size_t n = rows.count(), levels = a.grid.levels.size();
  if (n == 0) return;
  constexpr size_t kRange = 4096;  // a multiple of kGroup
  const size_t ranges = (n + kRange - 1) / kRange;
  const auto range = HWY_DYNAMIC_DISPATCH(forwardRange);
  context.pool.run(levels * ranges, [&](size_t task, int) {
    const size_t first = task % ranges * kRange;
    range(a, task / ranges, rows.begin + first, rows.begin + std::min(n, first + kRange));
  });
}

void run(Context& context, const HashGridBackward& a) {
  const HostRows rows = hostRows(a.samples);
  const size_t levels = a.grid.levels.size();
  if (rows.count() == 0) return;
  if (a.tableGradients) {
    // The additions to each entry are in sample order for any split, so the split may depend on the number of threads.
    const size_t splits = std::max<size_t>(1, 2 * context.pool.threads() / levels);
    const auto level = HWY_DYNAMIC_DISPATCH(backwardLevel);
    context.pool.run(levels * splits, [&](size_t task, int) {
      const size_t l = levels - 1 - task / splits, part = task % splits;  // the expensive fine levels first
      const uint64_t entries = a.grid.levels[l].entries;
      level(a, l, rows,
            {static_cast<uint32_t>(entries * part / splits), static_cast<uint32_t>(entries * (part + 1) / splits)});
    });
  }
  if (a.positionGradients) {
    const auto positions = HWY_DYNAMIC_DISPATCH(backwardPositions);
    context.pool.forRanges(rows.count(), 1024,
                           [&](size_t begin, size_t end) { positions(a, rows.begin + begin, rows.begin + end); });
  }
}

}  // namespace tessera::cpu
#endif

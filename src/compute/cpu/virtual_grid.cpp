// The virtual grid on the CPU. One bit per texel marks the texels that a batch needs. The row of a texel is the number
// of bits before it, so that rows are in the order of texels regardless of which thread set a bit, and neighbours in
// space are neighbours in memory. Samples are processed in groups: first the rows of their corners are looked up, then
// the attributes are loaded, so that loads do not wait for each other. The backward pass assigns each source of each
// block (with many threads, each part of its rows) to one task that processes all samples in order: it needs no
// atomics, and sums are the same for any number of threads.

#include "compute/virtual_grid.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <utility>
#include <vector>

#include "compute/cpu/kernels.h"
#include "compute/cpu/ranked_marks.h"
#include "compute/cpu/virtual_texels.h"
#include "compute/host_memory.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "compute/cpu/virtual_grid.cpp"
#include <hwy/foreach_target.h>
// after foreach_target
#include <hwy/cache_control.h>
#include <hwy/contrib/math/math-inl.h>
#include <hwy/highway.h>

#ifndef TESSERA_CPU_VIRTUAL_GRID_ONCE
#define TESSERA_CPU_VIRTUAL_GRID_ONCE
namespace tessera::cpu {

inline constexpr uint32_t kSources = 4;  // voxels, then planes 0, 1, 2
inline constexpr size_t kGroup = 16;     // samples whose corners are looked up together
inline constexpr uint32_t kWidth = VirtualGrid::kAttributes, kColours = kWidth - 1;

inline void planeCorners(const VirtualGrid& grid, int plane, const float* position, SourceCorners& corners) {
  const TexelPair b = texelPair(position[plane == 0 ? 1 : 0], grid.planes),
                  c = texelPair(position[plane == 2 ? 1 : 2], grid.planes);
  const uint32_t low = grid.planeTexel(plane, 0, c.low), high = grid.planeTexel(plane, 0, c.high);
  corners.texel[0] = low + b.low;
  corners.texel[1] = low + b.high;
  corners.texel[2] = high + b.low;
  corners.texel[3] = high + b.high;
  corners.weight[0] = (1 - b.share) * (1 - c.share);
  corners.weight[1] = b.share * (1 - c.share);
  corners.weight[2] = (1 - b.share) * c.share;
  corners.weight[3] = b.share * c.share;
}

inline uint32_t cornersOfSource(uint32_t source) {
  return source == 0 ? 8 : 4;
}
inline uint32_t firstCorner(uint32_t source) {
  return source == 0 ? 0 : 4 + 4 * source;
}

inline void sourceCorners(const VirtualGrid& grid, uint32_t source, const float* position, SourceCorners& corners) {
  if (source == 0) {
    voxelCorners(grid, position, corners);
  } else {
    planeCorners(grid, static_cast<int>(source) - 1, position, corners);
  }
}

// The attributes to interpolate: bytes if they are quantised (an eighth of a cache line per texel), otherwise floats.
struct Texels {
  const uint64_t* bytes = nullptr;
  const float* floats = nullptr;
  uint32_t rows = 0;
};

}  // namespace tessera::cpu
#endif

HWY_BEFORE_NAMESPACE();
namespace tessera::cpu::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using Lanes8 = hn::CappedTag<float, 8>;
constexpr size_t kVectors = 8 / hn::MaxLanes(Lanes8());
using Attributes = hn::Vec<Lanes8>[kVectors];

void quantiseRows(const float* attributes, size_t begin, size_t end, uint64_t* bytes) {
  for (size_t row = begin; row < end; ++row) {
    uint64_t packed = 0;
    for (uint32_t f = 0; f < kWidth; ++f) {
      const double byte = 255 * static_cast<double>(attributes[row * kWidth + f]) + 0.5;
      packed |= static_cast<uint64_t>(static_cast<int32_t>(byte)) << 8 * f;
    }
    bytes[row] = packed;
  }
}

// sums += weight · attributes of a row; rows beyond the last count as 1/2.
template <bool kBytes>
HWY_INLINE void addRow(const Texels& texels, uint32_t row, float weight, Attributes& sums) {
  const Lanes8 d;
  const auto w = hn::Set(d, weight);
  if (row >= texels.rows) {
    const auto half = hn::Set(d, kBytes ? 127.5f : 0.5f);
    for (size_t v = 0; v < kVectors; ++v) sums[v] = hn::MulAdd(w, half, sums[v]);
    return;
  }
  if constexpr (kBytes) {
    const hn::Rebind<uint8_t, Lanes8> d8;
    const hn::RebindToSigned<Lanes8> di;
    const uint8_t* from = reinterpret_cast<const uint8_t*>(texels.bytes + row);
    for (size_t v = 0; v < kVectors; ++v) {
      const auto value = hn::ConvertTo(d, hn::PromoteTo(di, hn::LoadU(d8, from + v * hn::Lanes(d))));
      sums[v] = hn::MulAdd(w, value, sums[v]);
    }
  } else {
    const float* from = texels.floats + size_t{row} * kWidth;
    for (size_t v = 0; v < kVectors; ++v) sums[v] = hn::MulAdd(w, hn::LoadU(d, from + v * hn::Lanes(d)), sums[v]);
  }
}

// The rows and weights of the corners of a group of samples.
struct GroupCorners {
  uint32_t row[kGroup][VirtualGrid::kCorners];
  float weight[kGroup][VirtualGrid::kCorners];
};

HWY_INLINE void lookUp(const VirtualGrid& grid, const Rows& rows, const uint32_t* blocks, const float* positions,
                       size_t begin, size_t count, GroupCorners& group) {
  uint32_t texel[kGroup][VirtualGrid::kCorners];
  for (size_t s = 0; s < count; ++s) {
    for (uint32_t source = 0; source < kSources; ++source) {
      SourceCorners corners;
      sourceCorners(grid, source, positions + 3 * (begin + s), corners);
      const uint32_t first = firstCorner(source);
      for (uint32_t k = 0; k < cornersOfSource(source); ++k) {
        texel[s][first + k] = corners.texel[k];
        group.weight[s][first + k] = corners.weight[k];
      }
    }
  }
  for (size_t s = 0; s < count; ++s) {
    for (uint32_t k = 0; k < VirtualGrid::kCorners; ++k) {
      if (rows.marks == nullptr) {
        group.row[s][k] = static_cast<uint32_t>((begin + s) * VirtualGrid::kCorners + k);
      } else {
        group.row[s][k] = rows.row(rows.word(blocks[begin + s], texel[s][k]), texel[s][k]);
      }
    }
  }
}

template <bool kBytes>
void forwardRange(const VirtualGridForward& a, const Texels& texels, size_t begin, size_t end) {
  const Lanes8 d;
  const Rows rows = makeTexelRows(a);
  const uint32_t* blocks = hostPointer(a.blockOfSample);
  const float* positions = hostPointer(a.positions);
  const float* steps = hostPointer(a.runtimeSteps);
  float* logDensities = hostPointer(a.logDensities);
  float* colours = hostPointer(a.colours);
  GroupCorners group;
  for (size_t first = begin; first < end; first += kGroup) {
    const size_t count = std::min(kGroup, end - first);
    lookUp(a.grid, rows, blocks, positions, first, count, group);
    for (size_t s = 0; s < count; ++s) {
      for (uint32_t k = 0; k < VirtualGrid::kCorners; ++k) {
        const uint32_t row = std::min(group.row[s][k], texels.rows);
        hwy::Prefetch(kBytes ? static_cast<const void*>(texels.bytes + row)
                             : static_cast<const void*>(texels.floats + size_t{row} * kWidth));
      }
    }
    for (size_t s = 0; s < count; ++s) {
      Attributes sums;
      for (size_t v = 0; v < kVectors; ++v) sums[v] = hn::Zero(d);
      for (uint32_t k = 0; k < VirtualGrid::kCorners; ++k) {
        addRow<kBytes>(texels, group.row[s][k], group.weight[s][k], sums);
      }
      // Σ w (2 q - 1) · range over four sources whose weights sum to 1 each.
      alignas(64) float sum[kWidth];
      for (size_t v = 0; v < kVectors; ++v) hn::Store(sums[v], d, sum + v * hn::Lanes(d));
      const float scale = kBytes ? 2.0f / 255 : 2.0f;
      const size_t sample = first + s;
      float logDensity = std::min(a.grid.densityRange * (scale * sum[0] - 4) - 1, 15.0f);
      if (a.minAlpha > 0 && -std::expm1(-std::exp(logDensity) * steps[sample]) < a.minAlpha) {
        logDensity = VirtualGrid::kCulled;
      }
      logDensities[sample] = logDensity;
      alignas(64) float activated[kWidth];
      for (size_t v = 0; v < kVectors; ++v) {
        const auto x = hn::Mul(hn::Set(d, -a.grid.featureRange),
                               hn::MulSub(hn::Set(d, scale), hn::Load(d, sum + v * hn::Lanes(d)), hn::Set(d, 4.0f)));
        hn::Store(hn::Div(hn::Set(d, 1.0f), hn::Add(hn::Set(d, 1.0f), hn::Exp(d, x))), d, activated + v * hn::Lanes(d));
      }
      std::memcpy(colours + sample * kColours, activated + 1, sizeof(float) * kColours);
    }
  }
}

void forwardBytes(const VirtualGridForward& a, const Texels& texels, size_t begin, size_t end) {
  forwardRange<true>(a, texels, begin, end);
}
void forwardFloats(const VirtualGridForward& a, const Texels& texels, size_t begin, size_t end) {
  forwardRange<false>(a, texels, begin, end);
}

// The gradients of the sums of attributes per sample, [8], multiplied by the scale of the dequantisation.
void sumGradients(const VirtualGridBackward& a, size_t begin, size_t end, float* out) {
  const float* logDensities = hostPointer(a.logDensities);
  const float* colours = hostPointer(a.colours);
  const float* densityGradients = hostPointer(a.logDensityGradients);
  const float* colourGradients = hostPointer(a.colourGradients);
  for (size_t s = begin; s < end; ++s) {
    const bool passes = logDensities[s] > VirtualGrid::kCulled / 2 && logDensities[s] < 15;
    out[s * kWidth] = passes ? 2 * a.grid.densityRange * densityGradients[s] : 0;
    for (uint32_t f = 0; f < kColours; ++f) {
      const float c = colours[s * kColours + f];
      out[s * kWidth + 1 + f] = 2 * a.grid.featureRange * colourGradients[s * kColours + f] * c * (1 - c);
    }
  }
}

// Adds the gradients of all samples of `block` to the rows [low, high) of one source.
void backwardSource(const VirtualGridBackward& a, const float* upstream, size_t samples, uint32_t block,
                    uint32_t source, uint32_t low, uint32_t high) {
  const Lanes8 d;
  const Rows rows = makeTexelRows(a);
  const uint32_t* blocks = hostPointer(a.blockOfSample);
  const float* positions = hostPointer(a.positions);
  float* gradients = hostPointer(a.attributeGradients);
  const uint32_t corners = cornersOfSource(source);
  uint32_t pendingSamples[kGroup];
  uint32_t row[kGroup][8];
  SourceCorners pendingCorners[kGroup];
  const auto flush = [&](size_t count) {
    for (size_t s = 0; s < count; ++s) {
      for (uint32_t k = 0; k < corners; ++k) {
        const uint32_t texel = pendingCorners[s].texel[k];
        row[s][k] = rows.row(rows.word(block, texel), texel);
        if (row[s][k] < high) hwy::Prefetch(gradients + size_t{row[s][k]} * kWidth);
      }
    }
    for (size_t s = 0; s < count; ++s) {
      Attributes g;
      for (size_t v = 0; v < kVectors; ++v) {
        g[v] = hn::LoadU(d, upstream + size_t{pendingSamples[s]} * kWidth + v * hn::Lanes(d));
      }
      for (uint32_t k = 0; k < corners; ++k) {
        if (row[s][k] < low || row[s][k] >= high) continue;
        float* to = gradients + size_t{row[s][k]} * kWidth;
        const auto w = hn::Set(d, pendingCorners[s].weight[k]);
        for (size_t v = 0; v < kVectors; ++v, to += hn::Lanes(d)) {
          hn::StoreU(hn::MulAdd(w, g[v], hn::LoadU(d, to)), d, to);
        }
      }
    }
  };
  size_t count = 0;
  for (size_t s = 0; s < samples; ++s) {
    if (blocks[s] != block) continue;
    bool any = false;
    for (uint32_t f = 0; f < kWidth; ++f) any |= upstream[s * kWidth + f] != 0;
    if (!any) continue;
    pendingSamples[count] = static_cast<uint32_t>(s);
    sourceCorners(a.grid, source, positions + 3 * s, pendingCorners[count]);
    if (++count == kGroup) flush(std::exchange(count, 0));
  }
  flush(count);
}

}  // namespace tessera::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace tessera::cpu {

HWY_EXPORT(quantiseRows);
HWY_EXPORT(forwardBytes);
HWY_EXPORT(forwardFloats);
HWY_EXPORT(sumGradients);
HWY_EXPORT(backwardSource);

namespace {

constexpr size_t kSamplesPerTask = 2048, kRowsPerTask = 16384;

void markSamples(const DistinctTexels& a, size_t begin, size_t end) {
  const uint32_t* blocks = hostPointer(a.blockOfSample);
  const float* positions = hostPointer(a.positions);
  uint32_t* marks = hostPointer(a.marks);
  const size_t words = a.grid.words();
  for (size_t s = begin; s < end; ++s) {
    uint32_t* ofBlock = marks + blocks[s] * words;
    for (uint32_t source = 0; source < a.grid.sources(); ++source) {
      SourceCorners corners;
      sourceCorners(a.grid, source, positions + 3 * s, corners);
      for (uint32_t k = 0; k < cornersOfSource(source); ++k) setMark(ofBlock, corners.texel[k]);
    }
  }
}

void placeTexel(const DistinctTexels& a, size_t row, uint32_t texel) {
  if (row >= a.texelCapacity) return;
  const std::array<float, 3> position = a.grid.texelPosition(texel);
  std::copy(position.begin(), position.end(), hostPointer(a.texelPositions) + 3 * row);
}

void placeEveryCorner(Context& context, const DistinctTexels& a, size_t samples) {
  const float* positions = hostPointer(a.positions);
  context.pool.forRanges(samples, kSamplesPerTask, [&](size_t begin, size_t end) {
    for (size_t s = begin; s < end; ++s) {
      for (uint32_t source = 0; source < a.grid.sources(); ++source) {
        SourceCorners corners;
        sourceCorners(a.grid, source, positions + 3 * s, corners);
        for (uint32_t k = 0; k < cornersOfSource(source); ++k) {
          placeTexel(a, s * a.grid.corners() + firstCorner(source) + k, corners.texel[k]);
        }
      }
    }
  });
}

}  // namespace

void run(Context& context, const DistinctTexels& a) {
  const size_t samples = hostCount(a.samples), words = a.grid.words(), all = a.blocks * words;
  uint32_t* first = hostPointer(a.firstTexel);
  std::fill(first, first + a.blocks + 1, 0u);
  if (!a.grid.shareTexels) {
    placeEveryCorner(context, a, samples);
    first[a.blocks] = static_cast<uint32_t>(samples * a.grid.corners());
    return;
  }
  uint32_t* marks = hostPointer(a.marks);
  uint32_t* ranks = hostPointer(a.ranks);
  clearMarks(context.pool, marks, all);
  context.pool.forRanges(samples, kSamplesPerTask, [&](size_t begin, size_t end) { markSamples(a, begin, end); });
  const uint32_t texels = rankMarks(context.pool, marks, ranks, all, [&](uint32_t row, size_t bit) {
    placeTexel(a, row, static_cast<uint32_t>(bit % (32 * words)));
  });
  for (uint32_t block = 0; block < a.blocks; ++block) first[block] = ranks[block * words];
  first[a.blocks] = texels;
}

void run(Context& context, const VirtualGridForward& a) {
  const size_t samples = hostCount(a.samples);
  const uint32_t texels = hostCount(a.texels);
  CHECK(a.attributes.count >= size_t{texels} * kWidth);
  const float* attributes = hostPointer(a.attributes);
  if (!a.grid.quantise) {
    const auto range = HWY_DYNAMIC_DISPATCH(forwardFloats);
    context.pool.forRanges(samples, kSamplesPerTask, [&](size_t begin, size_t end) {
      range(a, {nullptr, attributes, texels}, begin, end);
    });
    return;
  }
  // Reused between calls: fresh pages would cost more than computing the bytes.
  thread_local std::vector<uint64_t> bytes;
  if (bytes.size() < texels) bytes.resize(texels);
  uint64_t* quantised = bytes.data();
  const auto quantise = HWY_DYNAMIC_DISPATCH(quantiseRows);
  context.pool.forRanges(texels, kRowsPerTask,
                         [&](size_t begin, size_t end) { quantise(attributes, begin, end, quantised); });
  const auto range = HWY_DYNAMIC_DISPATCH(forwardBytes);
  context.pool.forRanges(samples, kSamplesPerTask, [&](size_t begin, size_t end) {
    range(a, {quantised, nullptr, texels}, begin, end);
  });
}

void run(Context& context, const VirtualGridBackward& a) {
  const size_t samples = hostCount(a.samples);
  const uint32_t* first = hostPointer(a.firstTexel);
  const uint32_t rows = hostCount(a.texels);
  thread_local std::vector<float> sumGradientBuffer;
  if (sumGradientBuffer.size() < samples * kWidth) sumGradientBuffer.resize(samples * kWidth);
  float* upstream = sumGradientBuffer.data();
  const auto ofSums = HWY_DYNAMIC_DISPATCH(sumGradients);
  context.pool.forRanges(samples, kSamplesPerTask, [&](size_t begin, size_t end) { ofSums(a, begin, end, upstream); });
  float* gradients = hostPointer(a.attributeGradients);
  context.pool.forRanges(rows, kRowsPerTask, [&](size_t begin, size_t end) {
    std::fill(gradients + begin * kWidth, gradients + end * kWidth, 0.0f);
  });
  if (!a.grid.shareTexels) {
    const float* positions = hostPointer(a.positions);
    context.pool.forRanges(samples, kSamplesPerTask, [&](size_t begin, size_t end) {
      for (size_t s = begin; s < end; ++s) {
        for (uint32_t source = 0; source < kSources; ++source) {
          SourceCorners corners;
          sourceCorners(a.grid, source, positions + 3 * s, corners);
          for (uint32_t k = 0; k < cornersOfSource(source); ++k) {
            const size_t row = s * VirtualGrid::kCorners + firstCorner(source) + k;
            if (row >= rows) break;
            for (uint32_t f = 0; f < kWidth; ++f) {
              gradients[row * kWidth + f] = corners.weight[k] * upstream[s * kWidth + f];
            }
          }
        }
      }
    });
    return;
  }
  // The additions to each row are in sample order for any split, so the split may depend on the number of threads.
  // Voxels have twice as many corners as a plane, and get twice as many parts.
  const auto source = HWY_DYNAMIC_DISPATCH(backwardSource);
  const size_t splits = std::max<size_t>(1, 2 * context.pool.threads() / (kSources * a.blocks));
  const size_t perBlock = (kSources + 1) * splits;
  context.pool.run(a.blocks * perBlock, [&](size_t task, int) {
    const uint32_t block = static_cast<uint32_t>(task / perBlock), part = static_cast<uint32_t>(task % perBlock);
    const uint64_t low = std::min(first[block], rows), high = std::min(first[block + 1], rows), count = high - low;
    if (count == 0) return;
    const bool voxels = part < 2 * splits;
    const uint32_t of = voxels ? 0 : static_cast<uint32_t>((part - 2 * splits) / splits) + 1;
    const uint64_t pieces = voxels ? 2 * splits : splits, piece = voxels ? part : (part - 2 * splits) % splits;
    // The rows of a source are consecutive, and each task processes one piece of them.
    const Rows rowsOfBlock = makeTexelRows(a);
    const auto findTexelRow = [&](uint32_t texel) {
      return texel >= a.grid.texels()
                 ? high
                 : std::min<uint64_t>(rowsOfBlock.row(rowsOfBlock.word(block, texel), texel), high);
    };
    const uint64_t begin = findTexelRow(of == 0 ? 0 : a.grid.planeTexel(static_cast<int>(of) - 1, 0, 0));
    const uint64_t end = findTexelRow(a.grid.planeTexel(static_cast<int>(of), 0, 0));
    source(a, upstream, samples, block, of, static_cast<uint32_t>(begin + (end - begin) * piece / pieces),
           static_cast<uint32_t>(begin + (end - begin) * (piece + 1) / pieces));
  });
}

}  // namespace tessera::cpu
#endif

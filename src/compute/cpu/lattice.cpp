// The lattice on the CPU: like the virtual grid (virtual_grid.cpp), with one cache line per corner. The backward pass
// assigns parts of the rows to tasks that process all samples in order: it needs no atomics, and sums are the same for
// any number of threads.

#include "compute/lattice.h"

#include <utility>

#include "compute/cpu/kernels.h"
#include "compute/cpu/virtual_texels.h"
#include "compute/host_memory.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "compute/cpu/lattice.cpp"
#include <hwy/foreach_target.h>
// after foreach_target
#include <hwy/cache_control.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace tessera::cpu::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using Tag = hn::CappedTag<float, 8>;  // at most 8 lanes, because groups of 8 columns need not be contiguous
constexpr size_t kColumns = LatticeForward::kColumns, kVectors = kColumns / hn::MaxLanes(Tag());
constexpr size_t kGroup = 16;  // samples whose corners are looked up together

struct GroupCorners {
  uint32_t row[kGroup][8];
  float weight[kGroup][8];
};

template <class Arguments>
HWY_INLINE void lookUp(const Arguments& a, const Rows& rows, const uint32_t* sample, size_t count, const float* lines,
                       GroupCorners& group) {
  const uint32_t* blocks = hostPointer(a.blockOfSample);
  const float* positions = hostPointer(a.positions);
  const uint32_t capacity = a.texels.capacity;
  for (size_t s = 0; s < count; ++s) {
    SourceCorners corners;
    voxelCorners(a.grid, positions + size_t{3} * sample[s], corners);
    for (size_t k = 0; k < 8; ++k) {
      const uint32_t texel = corners.texel[k];
      const uint32_t row = rows.marks == nullptr ? 8 * sample[s] + static_cast<uint32_t>(k)
                                                 : rows.row(rows.word(blocks[sample[s]], texel), texel);
      group.row[s][k] = row;
      group.weight[s][k] = corners.weight[k];
      if (row < capacity) hwy::Prefetch(lines + kColumns * row);
    }
  }
}

void mixRange(const LatticeForward& a, size_t begin, size_t end) {
  const Tag d;
  const Rows rows = makeTexelRows(a);
  const float* values = hostPointer(a.values);
  float* mixed = hostPointer(a.mixed.data);
  const uint32_t capacity = a.texels.capacity;
  GroupCorners group;
  for (size_t first = begin; first < end; first += kGroup) {
    const size_t count = std::min(kGroup, end - first);
    uint32_t sample[kGroup];
    for (size_t s = 0; s < count; ++s) sample[s] = static_cast<uint32_t>(first + s);
    lookUp(a, rows, sample, count, values, group);
    for (size_t s = 0; s < count; ++s) {
      hn::Vec<Tag> sums[kVectors];
      for (size_t v = 0; v < kVectors; ++v) sums[v] = hn::Zero(d);
      for (size_t k = 0; k < 8; ++k) {
        if (group.row[s][k] >= capacity) continue;
        const float* line = values + kColumns * group.row[s][k];
        const auto w = hn::Set(d, group.weight[s][k]);
        for (size_t v = 0; v < kVectors; ++v) sums[v] = hn::MulAdd(w, hn::LoadU(d, line + v * hn::Lanes(d)), sums[v]);
      }
      for (size_t v = 0; v < kVectors; ++v) {
        hn::StoreU(sums[v], d, mixed + a.mixed.offset(first + s, v * hn::Lanes(d)));
      }
    }
  }
}

// Adds the gradients of all samples of `block` to the rows [low, high).
void spreadRows(const LatticeBackward& a, size_t samples, uint32_t block, uint32_t low, uint32_t high) {
  const Tag d;
  const Rows rows = makeTexelRows(a);
  const uint32_t* blocks = hostPointer(a.blockOfSample);
  const float* upstream = hostPointer(a.mixedGradients.data);
  float* gradients = hostPointer(a.valueGradients);
  GroupCorners group;
  uint32_t pendingSamples[kGroup];
  const auto flush = [&](size_t count) {
    lookUp(a, rows, pendingSamples, count, gradients, group);
    for (size_t s = 0; s < count; ++s) {
      hn::Vec<Tag> g[kVectors];
      for (size_t v = 0; v < kVectors; ++v) {
        g[v] = hn::LoadU(d, upstream + a.mixedGradients.offset(pendingSamples[s], v * hn::Lanes(d)));
      }
      for (size_t k = 0; k < 8; ++k) {
        const uint32_t row = group.row[s][k];
        if (row < low || row >= high) continue;
        float* line = gradients + kColumns * row;
        const auto w = hn::Set(d, group.weight[s][k]);
        for (size_t v = 0; v < kVectors; ++v, line += hn::Lanes(d)) {
          hn::StoreU(hn::MulAdd(w, g[v], hn::LoadU(d, line)), d, line);
        }
      }
    }
  };
  size_t count = 0;
  for (size_t s = 0; s < samples; ++s) {
    if (blocks[s] != block) continue;
    pendingSamples[count++] = static_cast<uint32_t>(s);
    if (count == kGroup) flush(std::exchange(count, 0));
  }
  flush(count);
}

}  // namespace tessera::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace tessera::cpu {

HWY_EXPORT(mixRange);
HWY_EXPORT(spreadRows);

namespace {

constexpr size_t kSamplesPerTask = 2048, kRowsPerTask = 8192;

}  // namespace

void run(Context& context, const LatticeForward& a) {
  CHECK(a.grid.planes == 0u);
  const auto range = HWY_DYNAMIC_DISPATCH(mixRange);
  context.pool.forRanges(hostCount(a.samples), kSamplesPerTask,
                         [&](size_t begin, size_t end) { range(a, begin, end); });
}

void run(Context& context, const LatticeBackward& a) {
  CHECK(a.grid.planes == 0u);
  const size_t samples = hostCount(a.samples);
  const uint32_t rows = hostCount(a.texels);
  const uint32_t* first = hostPointer(a.firstTexel);
  float* gradients = hostPointer(a.valueGradients);
  context.pool.forRanges(rows, kRowsPerTask, [&](size_t begin, size_t end) {
    std::fill(gradients + LatticeForward::kColumns * begin, gradients + LatticeForward::kColumns * end, 0.0f);
  });
  const auto spread = HWY_DYNAMIC_DISPATCH(spreadRows);
  if (!a.grid.shareTexels) {  // every corner has a row of its own, in the order of samples
    spread(a, samples, 0, 0, rows);
    for (uint32_t block = 1; block < a.blocks; ++block) spread(a, samples, block, 0, rows);
    return;
  }
  // The additions to each row are in sample order for any split, so the split may depend on the number of threads.
  const size_t pieces = std::max<size_t>(1, 2 * context.pool.threads() / a.blocks);
  context.pool.run(a.blocks * pieces, [&](size_t task, int) {
    const uint32_t block = static_cast<uint32_t>(task / pieces);
    const uint64_t piece = task % pieces, low = std::min(first[block], rows),
                   count = std::min(first[block + 1], rows) - low;
    if (count == 0) return;
    spread(a, samples, block, static_cast<uint32_t>(low + count * piece / pieces),
           static_cast<uint32_t>(low + count * (piece + 1) / pieces));
  });
}

}  // namespace tessera::cpu
#endif

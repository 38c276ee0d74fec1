#include "compute/occupancy.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "base/random.h"
#include "compute/cpu/kernels.h"
#include "compute/host_memory.h"

namespace tessera::cpu {
namespace {

constexpr size_t kGrain = 1 << 14;  // fixed: partial sums are added in task order; a multiple of 32

bool bitAt(const uint32_t* bits, uint32_t cell) {
  return (bits[cell / 32] >> (cell % 32)) & 1;
}

// The marching step at the centre of a cell.
float stepAt(const MarchSpace& space, uint32_t cell) {
  if (space.cone <= 0) return space.minStep;
  const uint32_t r = space.gridResolution;
  float largest = 0;
  for (const uint32_t i : {cell % r, cell / r % r, cell / (r * r)}) {
    const float u = (static_cast<float>(i) + 0.5f) / static_cast<float>(r);
    largest = std::max(largest, std::abs(space.contracted ? 4 * u - 2 : 2 * u - 1));
  }
  const float distance = largest > 1 ? 1 / (2 - largest) : largest;
  return std::clamp(space.cone * distance, space.minStep, space.maxStep);
}

}  // namespace

void run(Context& context, const OccupancyPoints& a) {
  const uint32_t r = a.space.gridResolution;
  const uint32_t* candidates = hostPointer(a.candidates);
  const uint32_t all = candidates ? static_cast<uint32_t>(a.candidates.count) : r * r * r;
  const auto candidateCell = [&](uint32_t candidate) { return candidates ? candidates[candidate] : candidate; };
  const RandomStream random(a.seed, 0x0cc);
  const uint32_t* bits = hostPointer(a.occupancy);
  uint32_t* chosen = hostPointer(a.cells);
  float* positions = hostPointer(a.positions);
  context.pool.forRanges(a.cells.count, kGrain, [&](size_t begin, size_t end) {
    for (size_t p = begin; p < end; ++p) {
      const uint64_t point = a.first + p, index = 16 * point;
      uint32_t cell;
      if (point < a.uniform) {
        cell = candidateCell(a.uniform == all ? static_cast<uint32_t>(point) : random.below(index, all));
      } else {
        cell = candidateCell(random.below(index, all));
        for (int attempt = 1; attempt < 10 && !bitAt(bits, cell); ++attempt)
          cell = candidateCell(random.below(index + attempt, all));
      }
      chosen[p] = cell;
      const uint32_t at[3] = {cell % r, cell / r % r, cell / (r * r)};
      for (int axis = 0; axis < 3; ++axis) {
        positions[3 * p + axis] =
            (static_cast<float>(at[axis]) + random.uniform(index + 10 + axis)) / static_cast<float>(r);
      }
    }
  });
}

void run(Context& context, const OccupancyUpdate& a) {
  const uint32_t r = a.space.gridResolution, cells = r * r * r;
  const uint32_t* chosen = hostPointer(a.cells);
  const float* logDensity = hostPointer(a.logDensity.data);
  float* grid = hostPointer(a.grid);
  uint32_t* bits = hostPointer(a.occupancy);
  context.pool.forRanges(cells, kGrain, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      if (grid[i] > 0) grid[i] *= a.decay;
    }
  });
  for (size_t p = 0; p < a.points; ++p) {  // one thread, because cells may repeat
    float& value = grid[chosen[p]];
    if (value < 0) continue;
    value =
        std::max(value, std::exp(std::min(logDensity[a.logDensity.offset(p, 0)], 15.0f)) * stepAt(a.space, chosen[p]));
  }
  const size_t tasks = (cells + kGrain - 1) / kGrain;
  std::vector<double> sums(tasks), counts(tasks);
  context.pool.run(tasks, [&](size_t task, int) {
    double sum = 0, count = 0;
    for (size_t i = task * kGrain; i < std::min<size_t>(cells, (task + 1) * kGrain); ++i) {
      sum += std::max(grid[i], 0.0f);
      count += grid[i] >= 0;
    }
    sums[task] = sum;
    counts[task] = count;
  });
  double sum = 0, count = 0;
  for (size_t task = 0; task < tasks; ++task) {
    sum += sums[task];
    count += counts[task];
  }
  const float threshold = std::min(a.threshold, static_cast<float>(sum / std::max(count, 1.0)));
  context.pool.forRanges(cells / 32, kGrain / 32, [&](size_t begin, size_t end) {
    for (size_t word = begin; word < end; ++word) {
      uint32_t value = 0;
      for (uint32_t bit = 0; bit < 32; ++bit) value |= static_cast<uint32_t>(grid[32 * word + bit] > threshold) << bit;
      bits[word] = value;
    }
  });
}

void run(Context& context, const OccupancySamples& a) {
  const uint32_t rays = hostCount(a.rays), resolution = a.resolution;
  const uint32_t* firstSample = hostPointer(a.firstSample);
  const float* x = hostPointer(a.x.data);
  const float* positions = hostPointer(a.positions);
  struct Seen {
    uint32_t cell;
    float alpha;
  };
  constexpr size_t kRays = 256;
  const size_t tasks = (rays + kRays - 1) / kRays;
  std::vector<std::vector<Seen>> seenByTask(tasks);
  context.pool.run(tasks, [&](size_t task, int) {
    for (size_t ray = task * kRays; ray < std::min<size_t>(rays, (task + 1) * kRays); ++ray) {
      float transmittance = 1;
      for (uint32_t i = firstSample[ray]; i < firstSample[ray + 1] && transmittance > a.minTransmittance; ++i) {
        const float alpha = 1 / (1 + std::exp(-x[a.x.offset(i, 0)] - a.offset));
        uint32_t cell = 0;
        for (int axis = 2; axis >= 0; --axis) {
          const int place = static_cast<int>(positions[3 * size_t{i} + axis] * static_cast<float>(resolution));
          cell = cell * resolution + std::min(static_cast<uint32_t>(place), resolution - 1);
        }
        seenByTask[task].push_back({cell, alpha});
        transmittance *= 1 - alpha;
      }
    }
  });
  float* grid = hostPointer(a.grid);
  for (const std::vector<Seen>& seen : seenByTask) {  // one thread, because cells repeat
    for (const auto& [cell, alpha] : seen) {
      if (grid[cell] >= 0) grid[cell] = std::max(grid[cell], alpha);
    }
  }
}

}  // namespace tessera::cpu

#include "compute/occupancy.h"

#include <algorithm>
#include <cmath>

#include "base/random.h"
#include "compute/composite.h"
#include "compute/reference/convert.h"
#include "compute/reference/functions.h"

namespace tessera::reference {
namespace {

Point cellCentre(const MarchSpace& space, uint32_t cell) {
  const uint32_t resolution = space.gridResolution;
  return {(cell % resolution + 0.5) / resolution, (cell / resolution % resolution + 0.5) / resolution,
          (cell / resolution / resolution + 0.5) / resolution};
}

}  // namespace

OccupancyChoice occupancyPoints(const MarchSpace& space, uint32_t uniform, uint32_t occupied, uint64_t seed,
                                Indices candidates, Indices occupancy) {
  const uint32_t resolution = space.gridResolution;
  const uint32_t all =
      candidates.empty() ? resolution * resolution * resolution : static_cast<uint32_t>(candidates.size());
  const auto candidateCell = [&](uint32_t candidate) { return candidates.empty() ? candidate : candidates[candidate]; };
  const RandomStream random(seed, 0x0cc);
  OccupancyChoice choice;
  for (uint64_t i = 0; i < uint64_t{uniform} + occupied; ++i) {
    const uint64_t index = 16 * i;
    uint32_t cell = 0;
    if (i >= uniform) {
      for (uint32_t attempt = 0; attempt < 10; ++attempt) {
        cell = candidateCell(random.below(index + attempt, all));
        if (occupancy[cell / 32] >> cell % 32 & 1) break;
      }
    } else {
      cell = candidateCell(uniform == all ? static_cast<uint32_t>(i) : random.below(index, all));
    }
    choice.cells.push_back(cell);
    const uint32_t corner[3] = {cell % resolution, cell / resolution % resolution, cell / resolution / resolution};
    for (int a = 0; a < 3; ++a)
      choice.positions.push_back((static_cast<float>(corner[a]) + random.uniform(index + 10 + a)) /
                                 static_cast<float>(resolution));
  }
  return choice;
}

double marchStepAtCell(const MarchSpace& space, uint32_t cell) {
  double norm = 0;
  for (double u : cellCentre(space, cell)) norm = std::max(norm, std::abs(space.contracted ? 4 * u - 2 : 2 * u - 1));
  if (norm > 1) norm = 1 / (2 - norm);
  return std::clamp<double>(space.cone * norm, space.minStep, space.maxStep);
}

void occupancyUpdate(const MarchSpace& space, double decay, double threshold, Indices cells, View logDensity,
                     std::span<double> grid, std::span<uint32_t> occupancy) {
  for (double& value : grid)
    if (value > 0) value *= decay;
  for (size_t i = 0; i < cells.size(); ++i) {
    double& value = grid[cells[i]];
    if (value >= 0) value = std::max(value, std::exp(std::min(logDensity[i], 15.0)) * marchStepAtCell(space, cells[i]));
  }
  double sum = 0, count = 0;
  for (double value : grid) {
    if (value < 0) continue;
    sum += value;
    ++count;
  }
  const double limit = std::min(threshold, sum / std::max(count, 1.0));
  std::fill(occupancy.begin(), occupancy.end(), 0u);
  for (size_t cell = 0; cell < grid.size(); ++cell)
    if (grid[cell] > limit) occupancy[cell / 32] |= 1u << cell % 32;
}

void run(const OccupancyPoints& a) {
  const OccupancyChoice choice =
      occupancyPoints(a.space, a.uniform, a.occupied, a.seed, indices(a.candidates, a.candidates.count),
                      indices(a.occupancy, a.occupancy.count));
  std::copy_n(choice.cells.begin() + a.first, a.cells.count, hostPointer(a.cells));
  std::copy_n(choice.positions.begin() + 3 * size_t{a.first}, 3 * a.cells.count, hostPointer(a.positions));
}

void run(const OccupancyUpdate& a) {
  Doubles grid = doubles(a.grid, a.grid.count);
  occupancyUpdate(a.space, a.decay, a.threshold, indices(a.cells, a.points), doubles(a.logDensity, a.points), grid,
                  {hostPointer(a.occupancy), a.occupancy.count});
  store(a.grid, grid);
}

void run(const OccupancySamples& a) {
  const size_t rays = hostCount(a.rays);
  const Indices firstSample = indices(a.firstSample, rays + 1);
  const Doubles x = doubles(a.x, firstSample[rays]);
  float* const grid = hostPointer(a.grid);
  for (size_t ray = 0; ray < rays; ++ray) {
    double transmittance = 1;
    for (uint32_t i = firstSample[ray]; i < firstSample[ray + 1] && transmittance > a.minTransmittance; ++i) {
      const double alpha = computeOpacity(Extinction::logit, x[i] + a.offset, 0);
      uint32_t cell = 0;
      for (int axis = 2; axis >= 0; --axis) {
        const float position = hostPointer(a.positions)[3 * size_t{i} + axis];  // float, as devices must agree on cells
        const int place = static_cast<int>(position * static_cast<float>(a.resolution));
        cell = cell * a.resolution + std::min(static_cast<uint32_t>(place), a.resolution - 1);
      }
      if (grid[cell] >= 0) grid[cell] = std::max(grid[cell], static_cast<float>(alpha));
      transmittance *= 1 - alpha;
    }
  }
}

}  // namespace tessera::reference

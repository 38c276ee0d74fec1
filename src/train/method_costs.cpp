#include "train/method_costs.h"

#include <cmath>

#include "partition/partition.h"
#include "train/level_folders.h"

namespace tessera {
namespace {

// Returns the steps of all coarser levels, as a share of those of the finest.
double stepsOfCoarserLevels(const BlockDemand& demand, uint32_t top) {
  constexpr int64_t kFinest = 1000000;
  double steps = 0;
  for (uint32_t level = 1; level <= top; ++level)
    steps += static_cast<double>(levelSteps(demand.lodStepFraction, level, kFinest));
  return steps / static_cast<double>(kFinest);
}

}  // namespace

MethodCosts costsOnCapture(const Method& method, const Capture& capture, uint64_t gpuBytes) {
  constexpr double kSlowness = 1.4;        // of a step of coarser levels: 1.33 and 1.5 were measured, of `volume`
  constexpr double kLevelLook = 0.17;      // of a look through the photos for the finest level, measured of `volume`
  constexpr double kLevelBytes = 1.0 / 3;  // of coarser levels, each of which has a quarter of the next finer one's
  MethodCosts costs = method.costs;
  if (method.blockDemand == nullptr || capture.photosIn(Split::train).empty()) return costs;
  BlockRunOptions options;
  options.gpuBytes = gpuBytes;
  const BlockDemand demand = method.blockDemand(*method.settings(""), options);
  const Site site = findSite(capture);
  const BlockGrid grid = layOutBlocks(site.ground, site.region, site.heights, {}, demand.limits).grid;
  const double blocks = grid.cells();
  if (blocks <= 1) return costs;
  costs.bakeSeconds *= blocks;
  double bytes = static_cast<double>(costs.modelBytes) * blocks;
  if (demand.topLevel != nullptr && demand.lodStepFraction > 0) {
    const uint32_t top = demand.topLevel(static_cast<uint32_t>(grid.columns), static_cast<uint32_t>(grid.rows));
    costs.coarserLevels = kSlowness * stepsOfCoarserLevels(demand, top);
    costs.secondsPerBakedMegapixel *= 1 + kLevelLook * top;
    bytes *= 1 + kLevelBytes;
  }
  costs.modelBytes = std::llround(bytes);
  if (method.partsAlone) {
    costs.secondsPerStep *= blocks;  // each has all steps
    costs.secondsPerLaterStep *= blocks;
  } else if (gpuBytes == 0) {  // a GPU with memory of its own stores them
    costs.trainBytes += static_cast<int64_t>((blocks - 1) * demand.limits.bytesPerBlock);
  }
  return costs;
}

}  // namespace tessera

#include "representations/field/config.h"

#include <fmt/format.h>

#include "base/config_checks.h"

namespace tessera {

std::vector<ConfigField> FieldConfig::fields() {
  return {
      {"contracted", "the scene is unbounded: contract what lies outside the region of interest", &contracted},
      {"roi_margin", "region of interest relative to the one fitted to the capture", &roiMargin},
      {"grid_levels", "hash grid levels", &gridLevels},
      {"grid_features", "features per hash entry", &gridFeatures},
      {"grid_log2_size", "log2 of the entries of a level", &gridLog2Size},
      {"grid_base", "coarsest resolution", &gridBase},
      {"grid_finest", "finest resolution", &gridFinest},
      {"width", "hidden width of both networks: 16, 32, 64 or 128", &width},
      {"density_hidden", "hidden layers of the density network", &densityHidden},
      {"colour_hidden", "hidden layers of the colour network", &colourHidden},
      {"occupancy_resolution", "cells per axis of the occupancy grid", &occupancyResolution},
      {"near", "rays begin here, in halves of the region of interest", &near},
      {"far", "rays end here", &far},
      {"min_step", "shortest marching step", &minStep},
      {"cone", "marching step relative to distance; 0 for uniform steps", &cone},
      {"seed", "of everything random", &seed},
      {"samples_per_step", "samples that a step aims for; rays adapt", &samplesPerStep},
      {"samples_per_pass", "samples of which a step keeps everything at a time: fewer take less memory",
       &samplesPerPass},
      {"first_rays", "rays of the first step", &firstRays},
      {"most_rays", "rays that a step never exceeds", &mostRays},
      {"photo_budget_mib", "memory for decoded photos in MiB; 0: as they need, but at most half of the machine's",
       &photoBudgetMiB},
      {"steps_per_photo", "with a photo budget: steps after which one photo is exchanged", &stepsPerPhoto},
      {"occupancy_every", "steps between updates of the occupancy grid", &occupancyEvery},
      {"occupancy_warm_up", "steps during which updates look at every cell", &occupancyWarmUp},
      {"occupancy_share", "share of the cells that an update looks at, at random, and again among occupied ones",
       &occupancyShare},
      {"rate", "learning rate", &rate},
      {"final_rate_factor", "learning rate at the end, relative", &finalRateFactor},
      {"constant_rate_share", "share of the steps before the learning rate begins to fall", &constantRateShare},
      {"network_l2", "weight decay of the networks", &networkL2},
      {"table_l2", "weight decay of the hash table's entries that a step touches", &tableL2},
      {"exposure_rate", "learning rate of the photos' exposures", &exposureRate},
      {"loss", "colour loss: huber, mse or charbonnier", &loss},
      {"loss_parameter", "delta of huber, epsilon of charbonnier", &lossParameter},
      {"distortion", "weight of the distortion loss", &distortion},
      {"depth", "weight of the depth loss, on rays through sparse points", &depth},
      {"depth_tolerance", "of sparse points' distances, relative", &depthTolerance},
      {"known_share", "share of the rays through sparse points, in captures that have some", &knownShare},
      {"full_gradient_distance", "samples nearer to the camera learn more slowly, or fog gathers there",
       &fullGradientDistance},
      {"exposure", "fit an exposure to each photo", &exposure},
      {"random_background", "train against random colours behind the scene", &randomBackground},
  };
}

void FieldConfig::check() const {
  constexpr double kTiny = 1e-12, kHuge = 1e12;
  requireOneOf("grid_features", gridFeatures, {1, 2, 4, 8});
  requireWithin("grid_levels", gridLevels, 1, 128 / gridFeatures);
  requireWithin("grid_log2_size", gridLog2Size, 3, 28);
  requireWithin("grid_base", gridBase, 2, 1 << 20);
  requireWithin("grid_finest", gridFinest, gridBase, 1 << 20);
  requireOneOf("width", width, {16, 32, 64, 128});
  requireWithin("density_hidden", densityHidden, 1, 16);
  requireWithin("colour_hidden", colourHidden, 1, 16);
  requireWithin("occupancy_resolution", occupancyResolution, 4, 512);
  if (occupancyResolution % 4 != 0) {
    throw Error(fmt::format("--set occupancy_resolution={}", occupancyResolution), "", "is no multiple of 4",
                fmt::format("use occupancy_resolution={}", occupancyResolution / 4 * 4));
  }
  requireWithin("roi_margin", roiMargin, 1e-6, 1e6);
  requireWithin("near", near, 0, kHuge);
  requireWithin("far", far, near, kHuge);
  requireWithin("min_step", minStep, 1e-6, kHuge);
  requireWithin("cone", cone, 0, 1);
  const MarchSpace marched = space();
  const double steps = marched.stepIndex(marched.far) - marched.stepIndex(marched.near);
  if (!(steps <= kMostSteps)) {
    throw Error(fmt::format("--set min_step={} cone={} far={}", minStep, cone, far), "",
                fmt::format("a ray from near to far would take {:.0f} steps", steps),
                fmt::format("use longer ones or a nearer far: at most {} steps", kMostSteps));
  }
  requireWithin("samples_per_step", samplesPerStep, 64, 1 << 24);
  requireWithin("samples_per_pass", samplesPerPass, 64, 1 << 24);
  requireWithin("most_rays", mostRays, 64, 1 << 24);
  requireWithin("first_rays", firstRays, 1, mostRays);
  requireWithin("photo_budget_mib", photoBudgetMiB, 0, kHuge);
  requireWithin("steps_per_photo", stepsPerPhoto, 1, 1 << 30);
  requireWithin("occupancy_every", occupancyEvery, 1, 1 << 30);
  requireWithin("occupancy_warm_up", occupancyWarmUp, 0, 1 << 30);
  requireWithin("occupancy_share", occupancyShare, 0, 1);
  requireWithin("rate", rate, kTiny, kHuge);
  requireWithin("final_rate_factor", finalRateFactor, kTiny, kHuge);
  requireWithin("constant_rate_share", constantRateShare, 0, 1);
  requireWithin("network_l2", networkL2, 0, kHuge);
  requireWithin("table_l2", tableL2, 0, kHuge);
  requireWithin("exposure_rate", exposureRate, 0, kHuge);
  requireWithin("loss_parameter", lossParameter, kTiny, kHuge);
  requireWithin("distortion", distortion, 0, kHuge);
  requireWithin("depth", depth, 0, kHuge);
  requireWithin("depth_tolerance", depthTolerance, 0, 1);
  requireWithin("known_share", knownShare, 0, 1);
  requireWithin("full_gradient_distance", fullGradientDistance, 0, kHuge);
}

RadianceFieldShape FieldConfig::shape() const {
  check();
  HashGridOptions grid;
  grid.levels = gridLevels;
  grid.features = gridFeatures;
  grid.log2TableSize = gridLog2Size;
  grid.baseResolution = gridBase;
  grid.finestResolution = gridFinest;
  return makeRadianceFieldShape(grid, width, densityHidden, colourHidden);
}

MarchSpace FieldConfig::space() const {
  MarchSpace space;
  space.contracted = contracted;
  space.gridResolution = occupancyResolution;
  space.near = static_cast<float>(near);
  space.far = static_cast<float>(far);
  space.minStep = static_cast<float>(minStep);
  space.cone = static_cast<float>(cone);
  return space;
}

}  // namespace tessera

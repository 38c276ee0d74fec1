#include "representations/field/config.h"

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
      {"first_rays", "rays of the first step", &firstRays},
      {"most_rays", "rays that a step never exceeds", &mostRays},
      {"photo_budget_mib", "memory for decoded photos in MiB; 0: all that are needed", &photoBudgetMiB},
      {"steps_per_photo", "with a photo budget: steps after which one photo is exchanged", &stepsPerPhoto},
      {"occupancy_every", "steps between updates of the occupancy grid", &occupancyEvery},
      {"occupancy_warm_up", "steps during which updates look at every cell", &occupancyWarmUp},
      {"occupancy_share", "share of the cells that an update looks at, at random, and again among occupied ones", &occupancyShare},
      {"rate", "learning rate", &rate},
      {"final_rate_factor", "learning rate at the end, relative", &finalRateFactor},
      {"constant_rate_share", "share of the steps before the learning rate begins to fall", &constantRateShare},
      {"network_l2", "weight decay of the networks", &networkL2},
      {"exposure_rate", "learning rate of the photos' exposures", &exposureRate},
      {"loss", "colour loss: huber, mse or charbonnier", &loss},
      {"loss_parameter", "delta of huber, epsilon of charbonnier", &lossParameter},
      {"distortion", "weight of the distortion loss", &distortion},
      {"exposure", "fit an exposure to each photo", &exposure},
      {"random_background", "train against random colours behind the scene", &randomBackground},
  };
}

RadianceFieldShape FieldConfig::shape() const {
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

#include "representations/hash/config.h"

#include <fmt/format.h>

#include <cmath>

#include "base/config_checks.h"
#include "compute/lattice.h"
#include "tiles/dense_layer.h"
#include "train/block_frame.h"

namespace tessera {

HashConfig HashConfig::ofPreset(const std::string& name) {
  HashConfig config;
  config.preset = name;
  if (name == "cpu") return config;
  if (name != "paper") throw Error("--set preset=" + name, "", "there is no such preset", "use cpu or paper");
  config.surround = "border";
  config.background = "learned";
  config.lattice = 512;
  config.coarseLevels = 6;
  config.step = 0.5 * std::sqrt(3.0);  // half of a voxel's diagonal
  config.fineRateFactor = 1;
  config.rampShare = 0.5;
  config.distortion = 0.1;  // the paper's 0.01, beside ten times its Huber loss (compute/losses.h)
  config.warmUpSteps = 1000;
  config.rateFall = "linear";
  config.networkL2 = config.depth = config.knownShare = config.fullGradientDistance = 0;
  config.exposure = false;
  config.coarseLog2Size = 21;
  config.levels = 2;
  config.fineLog2Size = 22;
  config.samplesPerStep = 1 << 20;
  config.texelsPerStep = 1 << 21;
  return config;
}

std::vector<ConfigField> HashConfig::fields() {
  return {
      {"preset", "the defaults of all others: cpu, or paper (large graphics cards)", &preset},
      {"level", "of detail: 0 is the finest; set by training for those above", &level},
      {"finest_step", "of a coarser level: steps of the finest one when it was made; set by training", &finestStep},
      {"surround",
       "what lies outside the region: own (a block of its own), border (the border blocks'; with one block, as in the "
       "paper), none",
       &surround},
      {"background",
       "what is seen where rays end nowhere: random (whatever stands behind the scene), learned (what the directions' "
       "network says, as in the paper)",
       &background},
      {"near", "no sample nearer to a camera, in halves of a block", &near},
      {"lattice", "corners along an edge of a block, of coarse features and attention", &lattice},
      {"coarse_levels", "hash grid levels of a block's coarse features", &coarseLevels},
      {"coarse_features", "features per entry of it", &coarseFeatures},
      {"coarse_log2_size", "log2 of the entries of a level", &coarseLog2Size},
      {"coarse_base", "coarsest resolution; the finest is the lattice's", &coarseBase},
      {"width", "hidden width of the coarse features' networks: 16, 32, 64 or 128", &width},
      {"hidden", "hidden layers of them", &hidden},
      {"levels", "of fine features, the first of twice the lattice's resolution, each next one of twice as much",
       &levels},
      {"fine_log2_size", "log2 of the entries of a level", &fineLog2Size},
      {"aggregation", "how levels become one: attention, sum, or mlp (a network for each sample)", &aggregation},
      {"attention", "weights of a level: separate (of density and colours) or shared", &attention},
      {"attention_varies", "from place to place; else the whole model has one set", &attentionVaries},
      {"direction_width", "hidden width of the network for directions: 16, 32, 64 or 128", &directionWidth},
      {"direction_hidden", "hidden layers of it", &directionHidden},
      {"step", "longest step of a ray, in edges of the lattice", &step},
      {"occupancy_resolution", "cells along an edge of a block's occupancy", &occupancyResolution},
      {"seed", "of everything random", &seed},
      {"samples_per_step", "samples that a step aims for; rays adapt", &samplesPerStep},
      {"texels_per_step", "corners of the lattice that a step aims for at most", &texelsPerStep},
      {"first_rays", "rays of the first step", &firstRays},
      {"most_rays", "rays that a step never exceeds", &mostRays},
      {"photo_budget_mib", "memory for decoded photos in MiB; 0: as they need, but at most half of the machine's",
       &photoBudgetMiB},
      {"steps_per_photo", "with a photo budget: steps after which one photo is exchanged", &stepsPerPhoto},
      {"occupancy_every", "steps between updates of the occupancy", &occupancyEvery},
      {"occupancy_warm_up", "steps during which updates look at every cell", &occupancyWarmUp},
      {"occupancy_share", "share of the cells that an update looks at, at random, and again among occupied ones",
       &occupancyShare},
      {"rate", "learning rate", &rate},
      {"fine_rate_factor", "learning rate of the fine features, relative", &fineRateFactor},
      {"warm_up_steps", "steps during which the learning rate rises", &warmUpSteps},
      {"rate_fall",
       "exponential: by the two settings that follow; linear: from 0 to the learning rate and to 0 again, in lines, as "
       "in the paper",
       &rateFall},
      {"final_rate_factor", "learning rate at the end, relative", &finalRateFactor},
      {"constant_rate_share", "share of the steps before the learning rate begins to fall", &constantRateShare},
      {"network_l2", "weight decay of the networks", &networkL2},
      {"exposure_rate", "learning rate of the photos' exposures", &exposureRate},
      {"loss", "colour loss: huber, mse or charbonnier", &loss},
      {"loss_parameter", "delta of huber, epsilon of charbonnier", &lossParameter},
      {"distortion",
       "weight of the distortion loss; auto: the preset's, or 0.3 or 0.1 times that, whichever is best on one training "
       "photo in ten that is left out, after a short training with each",
       &distortion},
      {"ramp_share", "share of the steps over which it rises to its weight", &rampShare},
      {"full_gradient_distance",
       "samples nearer to the camera learn more slowly, or fog gathers there; in halves of a block",
       &fullGradientDistance},
      {"depth", "weight of the depth loss, on rays through sparse points", &depth},
      {"depth_tolerance", "of sparse points' distances, relative", &depthTolerance},
      {"known_share", "share of the rays through sparse points, in captures that have some", &knownShare},
      {"level_share",
       "steps of the first coarser level of detail, as a share of the finest's, each next one taking twice as many, up "
       "to the finest's; 0: no coarser levels",
       &levelShare},
      {"fewest_samples", "with fewer for each ray on average, steps become shorter", &fewestSamples},
      {"shortest_step", "of a ray, relative to the longest", &shortestStep},
      {"step_change", "by which share the length of steps changes from one training step to the next", &stepChange},
      {"exposure", "fit an exposure to each photo", &exposure},
  };
}

namespace {

void oneOf(const char* name, const std::string& value, std::initializer_list<const char*> allowed) {
  std::string all;
  for (const char* const each : allowed) {
    if (value == each) return;
    all += (all.empty() ? "" : ", ") + std::string(each);
  }
  throw Error(fmt::format("--set {}={}", name, value), "", "there is no such thing", "use one of: " + all);
}

// A viewer has the network's numbers in its shaders, in vectors of four.
void requireDrawable(const MlpShape& shape) {
  uint32_t vectors = 0;
  for (int layer = 0; layer < shape.layers(); ++layer) {
    const int inputs = layer == 0 ? shape.inputs : shape.width;
    const int outputs = layer == shape.hiddenLayers ? shape.outputs : shape.width;
    vectors += networkVectors(static_cast<uint32_t>(inputs), static_cast<uint32_t>(outputs));
  }
  if (vectors <= kMostNetworkVectors) return;
  throw Error(fmt::format("--set direction_width={} direction_hidden={}", shape.width, shape.hiddenLayers), "",
              fmt::format("a network of {} vectors of four numbers; scenes take {}", vectors, kMostNetworkVectors),
              "use a narrower or shallower one");
}

}  // namespace

void HashConfig::keepFound(const HashConfig& run) {
  if (distortion) return;
  if (!run.distortion) {
    throw Error("config.toml", "distortion", "is auto, where a run that has begun has a number",
                "restore the file, or train into another folder");
  }
  distortion = run.distortion;
}

void HashConfig::check() const {
  constexpr double kTiny = 1e-12, kHuge = 1e12;
  ofPreset(preset);
  surroundKind();
  oneOf("background", background, {"random", "learned"});
  oneOf("aggregation", aggregation, {"attention", "sum", "mlp"});
  oneOf("rate_fall", rateFall, {"exponential", "linear"});
  oneOf("attention", attention, {"separate", "shared"});
  requireWithin("level", level, 0, 16);
  requireWithin("level_share", levelShare, 0, 10);
  requireWithin("near", near, 0, 1);
  requireWithin("lattice", lattice, 8, 1024);
  if (lattice % 8 != 0) {
    throw Error(fmt::format("--set lattice={}", lattice), "", "is no multiple of 8",
                fmt::format("use lattice={}", (lattice + 4) / 8 * 8));
  }
  requireWithin("coarse_base", coarseBase, 2, lattice);
  requireOneOf("coarse_features", coarseFeatures, {1, 2, 4, 8});
  requireWithin("coarse_levels", coarseLevels, 1, 128 / coarseFeatures);
  requireWithin("coarse_log2_size", coarseLog2Size, 3, 28);
  requireOneOf("width", width, {16, 32, 64, 128});
  requireWithin("hidden", hidden, 1, 16);
  requireWithin("levels", levels, 1, static_cast<int>(AttentionShape::kMostLevels));
  requireWithin("fine_log2_size", fineLog2Size, 3, 24);
  requireOneOf("direction_width", directionWidth, {16, 32, 64, 128});
  requireWithin("direction_hidden", directionHidden, 1, static_cast<int>(kMostLayers) - 1);
  requireDrawable(directionShape());
  requireWithin("step", step, 0.01, 100);
  requireWithin("occupancy_resolution", occupancyResolution, 4, 512);
  if (occupancyResolution % 4 != 0) {
    throw Error(fmt::format("--set occupancy_resolution={}", occupancyResolution), "", "is no multiple of 4",
                fmt::format("use occupancy_resolution={}", occupancyResolution / 4 * 4));
  }
  requireWithin("samples_per_step", samplesPerStep, 64, 1 << 24);
  requireWithin("texels_per_step", texelsPerStep, 64, 1 << 26);
  requireWithin("most_rays", mostRays, 64, 1 << 24);
  requireWithin("first_rays", firstRays, 1, mostRays);
  requireWithin("photo_budget_mib", photoBudgetMiB, 0, kHuge);
  requireWithin("steps_per_photo", stepsPerPhoto, 1, 1 << 30);
  requireWithin("occupancy_every", occupancyEvery, 1, 1 << 30);
  requireWithin("occupancy_warm_up", occupancyWarmUp, 0, 1 << 30);
  requireWithin("occupancy_share", occupancyShare, 0, 1);
  requireWithin("rate", rate, kTiny, kHuge);
  requireWithin("fine_rate_factor", fineRateFactor, 0, kHuge);
  requireWithin("warm_up_steps", warmUpSteps, 1, 1 << 30);
  requireWithin("final_rate_factor", finalRateFactor, kTiny, kHuge);
  requireWithin("constant_rate_share", constantRateShare, 0, 1);
  requireWithin("network_l2", networkL2, 0, kHuge);
  requireWithin("exposure_rate", exposureRate, 0, kHuge);
  requireWithin("loss_parameter", lossParameter, kTiny, kHuge);
  if (distortion) requireWithin("distortion", *distortion, 0, kHuge);
  requireWithin("ramp_share", rampShare, 0, 1);
  requireWithin("full_gradient_distance", fullGradientDistance, 0, kHuge);
  requireWithin("depth", depth, 0, kHuge);
  requireWithin("depth_tolerance", depthTolerance, 0, 1);
  requireWithin("known_share", knownShare, 0, 1);
  requireWithin("fewest_samples", fewestSamples, 0, 1e6);
  requireWithin("shortest_step", shortestStep, 1e-3, 1);
  requireWithin("step_change", stepChange, 0, 0.5);
}

Surround HashConfig::surroundKind() const {
  return surroundNamed(surround);
}

AttentionShape HashConfig::attentionShape() const {
  AttentionShape shape;
  shape.levels = static_cast<uint32_t>(levels);
  shape.weights = aggregation == "sum"    ? AttentionWeights::none
                  : attention == "shared" ? AttentionWeights::shared
                                          : AttentionWeights::separate;
  shape.varies = attentionVaries;
  return shape;
}

VirtualGrid HashConfig::latticeGrid() const {
  VirtualGrid grid;
  grid.voxels = static_cast<uint32_t>(lattice);
  grid.planes = 0;
  return grid;
}

BlockFieldShape HashConfig::coarseShape() const {
  HashGridOptions grid;
  grid.levels = coarseLevels;
  grid.features = coarseFeatures;
  grid.log2TableSize = coarseLog2Size;
  grid.baseResolution = coarseBase;
  grid.finestResolution = lattice;
  return makeBlockFieldShape(grid, width, hidden, static_cast<int>(LatticeForward::kColumns), OutputActivation::none);
}

HashGrid HashConfig::fineGrid() const {
  HashGridOptions grid;
  grid.levels = levels;
  grid.features = static_cast<int>(AttentionShape::kFeatures);
  grid.log2TableSize = fineLog2Size;
  grid.baseResolution = 2 * lattice;
  grid.finestResolution = lattice << levels;
  return HashGrid(grid);
}

MlpShape HashConfig::mixShape() const {
  MlpShape shape;
  shape.inputs = static_cast<int>(LatticeForward::kColumns + AttentionShape::kFeatures * levels);
  shape.width = width;
  shape.hiddenLayers = 1;
  shape.outputs = static_cast<int>(AttentionShape::kFeatures);
  return shape;
}

MlpShape HashConfig::directionShape() const {
  MlpShape shape;
  shape.inputs = static_cast<int>(AttentionShape::kFeatures) - 1 + 16;
  shape.width = directionWidth;
  shape.hiddenLayers = directionHidden;
  shape.outputs = 3;
  return shape;
}

size_t HashConfig::multiplyAccumulates() const {
  constexpr size_t kCorners = 8, kFeatures = AttentionShape::kFeatures;
  const AttentionShape shape = attentionShape();
  const size_t fine = kFeatures * shape.levels;
  if (mixesByNetwork()) {
    const MlpShape mix = mixShape();
    return kCorners * (LatticeForward::kColumns + fine) + multiplyAccumulatesOf(mix);
  }
  const bool weighed = shape.weights != AttentionWeights::none;
  return kCorners * (kFeatures + (shape.varies ? shape.logits() : 0) + fine) + (weighed ? fine : 0);
}

}  // namespace tessera

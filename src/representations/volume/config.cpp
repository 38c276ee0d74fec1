#include "representations/volume/config.h"

#include <fmt/format.h>

#include "base/config_checks.h"
#include "train/block_frame.h"

namespace tessera {
namespace {

void multipleOfEight(const char* name, int value) {
  if (value % 8 == 0) return;
  throw Error(fmt::format("--set {}={}", name, value), "", "is no multiple of 8",
              fmt::format("use {}={}", name, (value + 4) / 8 * 8));
}

}  // namespace

VolumeConfig VolumeConfig::ofPreset(const std::string& name) {
  VolumeConfig config;
  config.preset = name;
  if (name == "cpu") return config;
  if (name != "paper") throw Error("--set preset=" + name, "", "there is no such preset", "use cpu or paper");
  config.voxels = 512;
  config.planes = 2048;
  config.gridLevels = 16;
  config.gridLog2Size = 19;
  config.gridFinest = 2048;
  config.width = 64;
  config.hidden = 3;
  config.proposalLog2Size = 17;
  config.proposalFinest = 256;
  config.firstIntervals = config.secondIntervals = 64;
  config.samples = 32;
  config.proposalEvery = 1;
  config.texelsPerStep = 1 << 22;
  config.sparsityPoints = 1 << 17;
  return config;
}

std::vector<ConfigField> VolumeConfig::fields() {
  return {
      {"preset", "the defaults of all others: cpu, or paper (large graphics cards)", &preset},
      {"surround",
       "what lies outside the region: own (a block of its own), border (the border blocks', as in the paper), none",
       &surround},
      {"level", "of detail: 0 is the finest; set by training for those above", &level},
      {"finest_step", "of a coarser level: steps of the finest one when it was made; set by training", &finestStep},
      {"near", "no sample nearer to a camera, in halves of a block", &near},
      {"voxels", "voxels along an edge of a block", &voxels},
      {"planes", "texels along an edge of a block's planes", &planes},
      {"feature_range", "colours and features span plus and minus this before their activation", &featureRange},
      {"density_range", "log densities likewise", &densityRange},
      {"quantise", "train through the bytes that tiles hold", &quantise},
      {"share_texels", "evaluate each texel of a step once; false: each corner of each sample (one block only)",
       &shareTexels},
      {"grid_levels", "hash grid levels of a block's attributes", &gridLevels},
      {"grid_log2_size", "log2 of the entries of a level", &gridLog2Size},
      {"grid_base", "coarsest resolution", &gridBase},
      {"grid_finest", "finest resolution", &gridFinest},
      {"width", "hidden width of the attribute networks: 16, 32, 64 or 128", &width},
      {"hidden", "hidden layers of the attribute networks", &hidden},
      {"proposal_levels", "hash grid levels of a block's proposals", &proposalLevels},
      {"proposal_log2_size", "log2 of the entries of a level", &proposalLog2Size},
      {"proposal_finest", "finest resolution", &proposalFinest},
      {"proposal_width", "hidden width of the proposal networks: 16, 32, 64 or 128", &proposalWidth},
      {"first_intervals", "of a ray in the first round of proposals", &firstIntervals},
      {"second_intervals", "in the second; 0 for one round", &secondIntervals},
      {"samples", "of a ray, more where it passes from block to block", &samples},
      {"padding", "share of the samples that are spread evenly whatever the proposals say", &padding},
      {"proposal_every", "steps between updates of the proposals after the warm-up", &proposalEvery},
      {"proposal_warm_up", "steps during which each updates the proposals", &proposalWarmUp},
      {"seed", "of everything random", &seed},
      {"resident_blocks", "blocks that are in memory at once, besides a surround of its own; 0: all", &residentBlocks},
      {"residency_steps", "steps in which all blocks get their turn, where not all are in memory", &residencySteps},
      {"texels_per_step", "texels that a step aims for; rays adapt", &texelsPerStep},
      {"first_rays", "rays of the first step", &firstRays},
      {"most_rays", "rays that a step never exceeds", &mostRays},
      {"photo_budget_mib",
       "memory for decoded photos in MiB; 0: as they need, but at most two fifths of what is planned for",
       &photoBudgetMiB},
      {"steps_per_photo", "with a photo budget: steps after which one photo is exchanged", &stepsPerPhoto},
      {"rate", "learning rate", &rate},
      {"final_rate_factor", "learning rate at the end, relative", &finalRateFactor},
      {"constant_rate_share", "share of the steps before the learning rate begins to fall", &constantRateShare},
      {"deferred_rate_factor", "learning rate of the deferred networks, relative", &deferredRateFactor},
      {"table_l2", "weight decay of the hash tables' entries that a step touches", &tableL2},
      {"network_l2", "weight decay of the networks", &networkL2},
      {"exposure_rate", "learning rate of the photos' exposures", &exposureRate},
      {"loss", "colour loss: charbonnier, mse or huber", &loss},
      {"loss_parameter", "epsilon of charbonnier, delta of huber", &lossParameter},
      {"s3im", "weight of the structural similarity of random pixels", &s3im},
      {"interlevel", "weight of the loss that trains proposals", &interlevel},
      {"distortion", "weight of the distortion loss", &distortion},
      {"sparsity", "weight of the loss on what stands at random points", &sparsity},
      {"opacity", "weight of the loss on blocks that are half seen through", &opacity},
      {"ramp_share", "share of the steps over which distortion, sparsity and opacity rise to their weight", &rampShare},
      {"sparsity_points", "random points of a step", &sparsityPoints},
      {"cull_begin", "share of the steps from which on what a renderer would not see is culled", &cullBegin},
      {"cull_end", "share of the steps at which the threshold is the last", &cullEnd},
      {"cull_first", "opacity of a renderer's step below which it is culled, at first", &cullFirst},
      {"cull_last", "in the end, and when baked", &cullLast},
      {"literal_eq3", "the deferred network's colour whole, as printed, not times the block's opacity", &literalEq3},
      {"full_gradient_distance",
       "samples nearer to the camera learn more slowly, or fog gathers there; in halves of a block",
       &fullGradientDistance},
      {"known_share", "share of the rays through sparse points, in captures that have some", &knownShare},
      {"known_bracket",
       "such rays begin and end this share of their distance before and behind the point: what they see stands there",
       &knownBracket},
      {"free_space", "nothing stands before the nearest sparse points that a photo shows", &freeSpace},
      {"blocks_only", "no rays from parts of photos that see no block, as where --grid is a part of the place",
       &blocksOnly},
      {"level_share",
       "steps of the first coarser level of detail, as a share of the finest's, each next one taking twice as many, up "
       "to the finest's; 0: there are none",
       &levelShare},
      {"frozen_share", "share of a coarser level's steps in which only its deferred networks are trained",
       &frozenShare},
      {"level_rate_factor", "learning rate of a coarser level's fields, relative", &levelRateFactor},
      {"level_padding",
       "padding of coarser levels, if more: else what their proposals pass over is not seen before it is drawn",
       &levelPadding},
      {"exposure", "fit an exposure to each photo", &exposure},
      {"random_background", "train against random colours behind the scene", &randomBackground},
  };
}

void VolumeConfig::check() const {
  constexpr double kTiny = 1e-12, kHuge = 1e12;
  surroundKind();
  ofPreset(preset);
  requireWithin("near", near, 0, 1);  // of tiles too, see docs/tile-format.md
  requireWithin("level", level, 0, 16);
  requireWithin("level_share", levelShare, 0, 10);
  requireWithin("frozen_share", frozenShare, 0, 1);
  requireWithin("level_rate_factor", levelRateFactor, 0, kHuge);
  requireWithin("level_padding", levelPadding, 0, 1);
  requireWithin("voxels", voxels, 8, 1024);
  requireWithin("planes", planes, 8, 4096);
  multipleOfEight("voxels", voxels);
  multipleOfEight("planes", planes);
  requireWithin("feature_range", featureRange, 0.1, 100);
  requireWithin("density_range", densityRange, 0.1, 100);
  requireWithin("grid_levels", gridLevels, 1, 64);
  requireWithin("grid_log2_size", gridLog2Size, 3, 28);
  requireWithin("grid_base", gridBase, 2, 1 << 20);
  requireWithin("grid_finest", gridFinest, gridBase, 1 << 20);
  requireOneOf("width", width, {16, 32, 64, 128});
  requireWithin("hidden", hidden, 1, 16);
  requireWithin("proposal_levels", proposalLevels, 1, 64);
  requireWithin("proposal_log2_size", proposalLog2Size, 3, 28);
  requireWithin("proposal_finest", proposalFinest, gridBase, 1 << 20);
  requireOneOf("proposal_width", proposalWidth, {16, 32, 64, 128});
  requireWithin("first_intervals", firstIntervals, 2, 1024);
  requireWithin("second_intervals", secondIntervals, 0, 1024);
  requireWithin("samples", samples, 2, 1024);
  requireWithin("padding", padding, 0, 1);
  requireWithin("proposal_every", proposalEvery, 1, 1 << 20);
  requireWithin("proposal_warm_up", proposalWarmUp, 0, 1 << 30);
  requireWithin("resident_blocks", residentBlocks, 0, 1 << 20);
  requireWithin("residency_steps", static_cast<double>(residencySteps), 1, 1e9);
  requireWithin("texels_per_step", texelsPerStep, 1024, 1 << 26);
  requireWithin("most_rays", mostRays, 64, 1 << 20);
  requireWithin("first_rays", firstRays, 16, mostRays);
  requireWithin("photo_budget_mib", photoBudgetMiB, 0, kHuge);
  requireWithin("steps_per_photo", stepsPerPhoto, 1, 1 << 30);
  requireWithin("rate", rate, kTiny, kHuge);
  requireWithin("final_rate_factor", finalRateFactor, kTiny, kHuge);
  requireWithin("constant_rate_share", constantRateShare, 0, 1);
  requireWithin("deferred_rate_factor", deferredRateFactor, 0, kHuge);
  requireWithin("table_l2", tableL2, 0, kHuge);
  requireWithin("network_l2", networkL2, 0, kHuge);
  requireWithin("exposure_rate", exposureRate, 0, kHuge);
  requireWithin("loss_parameter", lossParameter, kTiny, kHuge);
  requireWithin("s3im", s3im, 0, kHuge);
  requireWithin("interlevel", interlevel, kTiny, kHuge);
  requireWithin("distortion", distortion, 0, kHuge);
  requireWithin("sparsity", sparsity, 0, kHuge);
  requireWithin("opacity", opacity, 0, kHuge);
  requireWithin("ramp_share", rampShare, 0, 1);
  requireWithin("known_share", knownShare, 0, 1);
  requireWithin("known_bracket", knownBracket, 0, 1);
  requireWithin("full_gradient_distance", fullGradientDistance, 0, kHuge);
  requireWithin("sparsity_points", sparsityPoints, 0, 1 << 24);
  requireWithin("cull_begin", cullBegin, 0, 1);
  requireWithin("cull_end", cullEnd, cullBegin, 1);
  requireWithin("cull_first", cullFirst, kTiny, 1);
  requireWithin("cull_last", cullLast, cullFirst, 1);
}

Surround VolumeConfig::surroundKind() const {
  return surroundNamed(surround);
}

VirtualGrid VolumeConfig::virtualGrid() const {
  VirtualGrid grid;
  grid.voxels = static_cast<uint32_t>(voxels);
  grid.planes = static_cast<uint32_t>(planes);
  grid.quantise = quantise;
  grid.shareTexels = shareTexels;
  grid.featureRange = static_cast<float>(featureRange);
  grid.densityRange = static_cast<float>(densityRange);
  return grid;
}

BlockFieldShape VolumeConfig::attributeShape() const {
  HashGridOptions grid;
  grid.levels = gridLevels;
  grid.log2TableSize = gridLog2Size;
  grid.baseResolution = gridBase;
  grid.finestResolution = gridFinest;
  return makeBlockFieldShape(grid, width, hidden, static_cast<int>(VirtualGrid::kAttributes),
                             OutputActivation::sigmoid);
}

BlockFieldShape VolumeConfig::proposalShape() const {
  HashGridOptions grid;
  grid.levels = proposalLevels;
  grid.log2TableSize = proposalLog2Size;
  grid.baseResolution = gridBase;
  grid.finestResolution = proposalFinest;
  return makeBlockFieldShape(grid, proposalWidth, 1, 1, OutputActivation::none);
}

}  // namespace tessera

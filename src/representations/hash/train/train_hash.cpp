#include "representations/hash/train/train_hash.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "bake/levels.h"
#include "base/error.h"
#include "base/log.h"
#include "representations/hash/content/hash_payload.h"
#include "representations/hash/train/tune_distortion_weight.h"

namespace tessera {

double trainingBytesPerBlock(const HashConfig& config) {
  constexpr double kPerParameter = 5 * sizeof(float);  // values, gradients, two moments, counts
  const BlockFieldShape coarse = config.coarseShape();
  const size_t parameters = coarse.grid.parameters() + coarse.network.parameters() + config.fineGrid().parameters();
  const double cells = std::pow(config.occupancyResolution, 3);
  return kPerParameter * static_cast<double>(parameters) + 2.0 * sizeof(uint32_t) * config.latticeGrid().words() +
         cells * (sizeof(float) + sizeof(uint32_t));
}

HashConfig levelConfig(HashConfig finest, uint32_t level, int64_t finestStep) {
  const int by = static_cast<int>(level);
  finest.lod = by;
  finest.finestStep = finestStep;
  finest.lattice = std::max(8, (finest.lattice >> by) / 8 * 8);
  finest.coarseBase = std::min(finest.coarseBase, finest.lattice);
  finest.fineLevels = std::max(1, finest.fineLevels - by);
  finest.fineLog2Size = std::min(finest.fineLog2Size, std::max(8, finest.fineLog2Size - 2 * by));
  finest.occupancyResolution =
      std::min(finest.occupancyResolution, std::max(16, (finest.occupancyResolution >> by) / 4 * 4));
  return finest;
}

namespace {

// Returns the coarsest level. A content of more blocks could not be drawn in most browsers: a uniform block of 64 KiB
// holds 215 parts with one table each.
uint32_t topHashLevel(uint32_t columns, uint32_t rows) {
  constexpr uint32_t kMaxBlocks = 128;
  return topLevel(columns, rows, kMaxBlocks);
}

// Throws Error, before anything is trained, if a level could not be baked because of its step length.
void requireStepsOfScenes(const HashConfig& config) {
  const double longest = config.longestStep(), shortest = config.minRayStepRatio * longest;
  if (longest <= kLongestHashStep && shortest >= kShortestHashStep) return;
  throw Error(fmt::format("--set max_ray_step={}", config.maxRayStep), "",
              fmt::format("at level {}, with {} corners along an edge, rays take steps of {:.3g} to {:.3g} of a block, "
                          "where scenes have {:.3g} to {:.3g}",
                          config.lod, config.lattice, shortest, longest, kShortestHashStep, kLongestHashStep),
              "use another one, or lod_step_fraction=0");
}

BlockLimits makeBlockLimits(const HashConfig& config, const BlockRunOptions& options) {
  BlockLimits limits;
  limits.texelsPerEdge = config.lattice << config.fineLevels;
  limits.bytesPerBlock = trainingBytesPerBlock(config);
  limits.memoryBudget = options.bytesForBlocks();
  return limits;
}

class HashMethod final : public BlockMethod {
 public:
  HashMethod(const TrainHashOptions& options, const fs::path& model)
      : options_(options), model_(model), finest_(options.config) {}

  PartitionRequirements partitionRequirements() const override {
    return {[&] { return makeBlockLimits(options_.config, options_); },
            {kEnoughPhotos, int64_t{finest_.lattice} * finest_.lattice},
            finest_.photoBudgetMiB};
  }
  double lodStepFraction() const override { return finest_.lodStepFraction; }
  uint32_t topLevel(const BlockGrid& grid) const override {
    return topHashLevel(static_cast<uint32_t>(grid.columns), static_cast<uint32_t>(grid.rows));
  }
  void open(const BlockRun& run, uint32_t top) override {
    finest_.photoBudgetMiB = run.photoBudgetMiB;
    for (uint32_t level = 0; level <= top; ++level) requireStepsOfScenes(levelConfig(finest_, level, 0));
  }
  bool findSettings(const BlockTraining& on, const BlockRun& run, TrainingLoopOptions& loop,
                    const std::function<void()>& begun) override;
  std::unique_ptr<TrainableModel> begin(const BlockTraining& on, const BlockLevel& level) override;
  std::vector<ConfigField> settings() override { return config_.fields(); }
  std::string parts() const override { return fmt::format("{} tiles", tiles_); }
  void reportMemory(const BlockTraining& on) const override;
  int64_t finestStepOfLevel(const fs::path& folder) const override {
    return savedConfig<HashConfig>(folder).finestStep;
  }

 private:
  const TrainHashOptions& options_;
  const fs::path& model_;
  HashConfig finest_, config_;  // settings of the finest level, and of the level that was begun last
  size_t tiles_ = 0;
};

// Determines the weight of the distortion loss.
bool HashMethod::findSettings(const BlockTraining& on, const BlockRun& run, TrainingLoopOptions& loop,
                              const std::function<void()>& begun) {
  if (finest_.distortionWeight) {
    if (!run.goesOn) fs::remove(distortionFile(model_));  // it belongs to another run
    return true;
  }
  if (!loop.resume) fs::remove(distortionFile(model_));
  return tuneDistortionWeight(on, model_, finest_, loop, begun);
}

std::unique_ptr<TrainableModel> HashMethod::begin(const BlockTraining& on, const BlockLevel& level) {
  config_ = level.level > 0 ? levelConfig(finest_, level.level, level.finestStep) : finest_;
  tiles_ =
      groupsOfLevel(static_cast<uint32_t>(on.grid.columns), static_cast<uint32_t>(on.grid.rows), level.level, false)
          .cells.size();
  auto trainer = std::make_unique<HashTrainer>(on.device, on.capture, config_, on.grid);
  if (level.level > 0) trainer->holdExposures(level.below);
  return trainer;
}

void HashMethod::reportMemory(const BlockTraining& on) const {
  reportMemoryUse(on, options_,
                  {finest_.photoBudgetMiB, trainingBytesPerBlock(finest_), "",
                   "lower samples_per_step, texels_per_step or photo_budget_mib, or use --method volume with "
                   "--resident-blocks"});
}

}  // namespace

BlockDemand hashBlockDemand(const HashConfig& config, const BlockRunOptions& options) {
  return {makeBlockLimits(config, options), config.lodStepFraction, topHashLevel};
}

TrainingResult trainHash(Device& device, const Capture& capture, const fs::path& model, TrainHashOptions options) {
  HashConfig& config = options.config;
  if (options.loop.resume && ModelFolder(model).manifest()) config.adoptTunedValues(savedConfig<HashConfig>(model));
  config.check();
  options.loop.method = "hash";
  HashMethod method(options, model);
  return trainInBlocks(device, capture, model, options, method);
}

}  // namespace tessera

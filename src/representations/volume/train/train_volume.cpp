#include "representations/volume/train/train_volume.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/error.h"
#include "base/log.h"

namespace tessera {
namespace {

// Returns the coarsest level. A content of more blocks could not be drawn in most browsers: a uniform block of 64 KiB
// holds 645 parts, and 2048 layers of a texture the planes of 682.
uint32_t topVolumeLevel(uint32_t columns, uint32_t rows) {
  constexpr uint32_t kMaxBlocks = 512;
  return topLevel(columns, rows, kMaxBlocks);
}

constexpr double kMiB = 1048576;
constexpr double kWarnFraction = 0.02;  // of the pixels are excluded from training
constexpr const char* kWaiting = "waiting";

BlockLimits makeBlockLimits(const VolumeConfig& config, const BlockRunOptions& options) {
  BlockLimits limits;
  limits.texelsPerEdge = config.planes;
  limits.bytesPerBlock = trainingBytesPerBlock(config);
  limits.memoryBudget = options.bytesForBlocks();
  const int resident = config.residentBlocks;
  if (resident == 0) return limits;
  const double bytes = resident * limits.bytesPerBlock;
  if (bytes > limits.memoryBudget) {
    warn(
        "{} blocks in memory at a time take {:.0f} MiB, more than the {:.0f} that are meant for them; lower "
        "--resident-blocks",
        resident, bytes / kMiB, limits.memoryBudget / kMiB);
  }
  limits.memoryBudget = std::numeric_limits<double>::infinity();  // however many blocks there are
  return limits;
}

}  // namespace

double trainingBytesPerBlock(const VolumeConfig& config) {
  constexpr double kPerParameter = 5 * sizeof(float);  // value, gradient, two moments, count
  const BlockFieldShape attributes = config.attributeShape(), proposals = config.proposalShape();
  const size_t parameters = attributes.grid.parameters() + attributes.network.parameters() +
                            proposals.grid.parameters() + proposals.network.parameters();
  return kPerParameter * static_cast<double>(parameters) + 2.0 * sizeof(uint32_t) * config.virtualGrid().words();
}

VolumeConfig levelConfig(VolumeConfig finest, uint32_t level, int64_t finestStep) {
  finest.lod = static_cast<int>(level);
  finest.finestStep = finestStep;
  finest.voxels = std::max(8, (finest.voxels >> level) / 8 * 8);
  finest.planes = std::max(8, (finest.planes >> level) / 8 * 8);
  // Its proposals start as those of the finest level, which skip the fog that large texels create around surfaces.
  finest.uniformSampleFraction = std::max(finest.uniformSampleFraction, finest.lodUniformSampleFraction);
  return finest;
}

namespace {

class VolumeMethod final : public BlockMethod {
 public:
  explicit VolumeMethod(const TrainVolumeOptions& options) : options_(options), finest_(options.config) {}

  PartitionRequirements partitionRequirements() const override {
    return {[&] { return makeBlockLimits(options_.config, options_); },
            {kEnoughPhotos, int64_t{finest_.planes} * finest_.planes / 16},
            finest_.photoBudgetMiB};
  }
  double lodStepFraction() const override { return finest_.lodStepFraction; }
  uint32_t topLevel(const BlockGrid& grid) const override {
    return topVolumeLevel(static_cast<uint32_t>(grid.columns), static_cast<uint32_t>(grid.rows));
  }
  void open(const BlockRun& run, uint32_t) override { finest_.photoBudgetMiB = run.photoBudgetMiB; }
  bool findSettings(const BlockTraining&, const BlockRun&, TrainingLoopOptions&,
                    const std::function<void()>&) override {
    return true;
  }
  std::unique_ptr<TrainableModel> begin(const BlockTraining& on, const BlockLevel& level) override;
  std::vector<ConfigField> settings() override { return config_.fields(); }
  std::string parts() const override { return fmt::format("{} models", models_); }
  void reportMemory(const BlockTraining& on) const override;
  void setPlannedSteps(int64_t steps) const override;
  int64_t finestStepOfLevel(const fs::path& folder) const override {
    return savedConfig<VolumeConfig>(folder).finestStep;
  }

 private:
  const TrainVolumeOptions& options_;
  VolumeConfig finest_, config_;            // of the finest level, and of the level begun last
  const VolumeTrainer* trainer_ = nullptr;  // of the level begun last
  size_t models_ = 0;
};

std::unique_ptr<TrainableModel> VolumeMethod::begin(const BlockTraining& on, const BlockLevel& level) {
  config_ = finest_;
  if (level.level > 0) {
    config_ = levelConfig(finest_, level.level, level.finestStep);
    config_.residencySteps = std::min(config_.residencySteps, level.steps);  // every block must become resident
  }
  auto trainer =
      std::make_unique<VolumeTrainer>(on.device, on.capture, config_, on.grid, level.folder.root() / kWaiting);
  if (level.level > 0) trainer->holdExposures(level.below);
  if (level.level > 0 && !level.folder.manifest()) trainer->beginFrom(level.below.root());
  trainer_ = trainer.get();
  models_ = trainer->model().groups().cells.size();
  return trainer;
}

void VolumeMethod::reportMemory(const BlockTraining& on) const {
  const Residency* residency = trainer_->residency();
  MemoryNeeds needs;
  needs.photoBudgetMiB = config_.photoBudgetMiB;
  needs.bytesPerBlock = trainingBytesPerBlock(config_);
  needs.remedy = "use --resident-blocks, or lower texels_per_step or photo_budget_mib";
  if (residency) {
    needs.how = fmt::format(", with {} of {} blocks at a time, {} resident sets in {} steps", config_.residentBlocks,
                            on.grid.cells(), residency->residentSets().size(), residency->cycleSteps());
  }
  reportMemoryUse(on, options_, needs);
  if (!residency) return;
  const std::vector<uint32_t> never = residency->neverServed();
  if (!never.empty()) {
    const uint32_t columns = static_cast<uint32_t>(on.grid.columns);
    std::vector<std::string> names;
    for (const uint32_t block : never) names.push_back(fmt::format("({}, {})", block % columns, block / columns));
    warn(
        "blocks {} are visible only through sets of more than {} blocks, which are never in memory together, and will "
        "hold nothing; raise --resident-blocks",
        fmt::join(names, ", "), config_.residentBlocks);
  }
  if (residency->unserved() < kWarnFraction) return;
  warn(
      "{:.0f} % of what the photos show is seen through more than {} blocks, or rare sets of them, and not trained on; "
      "raise --resident-blocks",
      100 * residency->unserved(), config_.residentBlocks);
}

void VolumeMethod::setPlannedSteps(int64_t steps) const {
  const int64_t cycle = trainer_->residency() ? trainer_->residency()->cycleSteps() : 0;
  if (steps >= cycle) return;
  warn(
      "all blocks get their turn in {} steps, and there are {}: some are trained too little, or not at all; train for "
      "longer, raise --resident-blocks, or lower residency_steps",
      cycle, steps);
}

}  // namespace

BlockDemand volumeBlockDemand(const VolumeConfig& config, const BlockRunOptions& options) {
  return {makeBlockLimits(config, options), config.lodStepFraction, topVolumeLevel};
}

TrainingResult trainVolume(Device& device, const Capture& capture, const fs::path& model, TrainVolumeOptions options) {
  options.config.check();
  options.loop.method = "volume";
  VolumeMethod method(options);
  return trainInBlocks(device, capture, model, options, method);
}

std::unique_ptr<VolumeModel> loadVolumeModel(Device& device, const fs::path& folder, uint32_t residentBlocks) {
  const ModelFolder model(folder);
  const ModelManifest manifest = requireManifest(model, "volume");
  VolumeConfig config;
  configFromToml(config.fields(), model.configPath());
  auto loaded =
      std::make_unique<VolumeModel>(device, config, requireGrid(model), VolumeModel::Capacity{residentBlocks, false});
  requireOneFileABlock(folder, manifest, loaded->space().blocks());
  std::vector<fs::path> files;
  for (const std::string& file : manifest.files) files.push_back(folder / file);
  loaded->readFrom(std::move(files));
  return loaded;
}

}  // namespace tessera

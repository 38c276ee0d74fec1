#include "representations/volume/train/train_volume.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/error.h"
#include "base/log.h"

namespace tessera {
namespace {

constexpr double kMiB = 1048576;
constexpr double kWorthSaying = 0.02;  // of the pixels are not trained on
constexpr const char* kWaiting = "waiting";

BlockLimits limitsOf(const TrainVolumeOptions& options) {
  BlockLimits limits;
  limits.texelsPerEdge = options.config.planes;
  limits.bytesPerBlock = trainingBytesPerBlock(options.config);
  limits.memoryBudget = options.bytesForBlocks();
  const int resident = options.config.residentBlocks;
  if (resident == 0) return limits;
  const double bytes = resident * limits.bytesPerBlock;
  if (bytes > limits.memoryBudget) {
    warn(
        "{} blocks in memory at a time take {:.0f} MiB, more than the {:.0f} that are meant for them; lower "
        "--resident-blocks",
        resident, bytes / kMiB, limits.memoryBudget / kMiB);
  }
  limits.memoryBudget = std::numeric_limits<double>::infinity();  // however many there are
  return limits;
}

}  // namespace

double trainingBytesPerBlock(const VolumeConfig& config) {
  constexpr double kPerParameter = 5 * sizeof(float);  // values, gradients, two moments, counts
  const BlockFieldShape attributes = config.attributeShape(), proposals = config.proposalShape();
  const size_t parameters = attributes.grid.parameters() + attributes.network.parameters() +
                            proposals.grid.parameters() + proposals.network.parameters();
  return kPerParameter * static_cast<double>(parameters) + 2.0 * sizeof(uint32_t) * config.virtualGrid().words();
}

VolumeConfig levelConfig(VolumeConfig finest, uint32_t level, int64_t finestStep) {
  finest.level = static_cast<int>(level);
  finest.finestStep = finestStep;
  finest.voxels = std::max(8, (finest.voxels >> level) / 8 * 8);
  finest.planes = std::max(8, (finest.planes >> level) / 8 * 8);
  // Its proposals begin as the finest level's, which pass over the fog that large texels make around surfaces.
  finest.padding = std::max(finest.padding, finest.levelPadding);
  return finest;
}

namespace {

class VolumeMethod final : public BlockMethod {
 public:
  explicit VolumeMethod(const TrainVolumeOptions& options) : options_(options), finest_(options.config) {}

  BlockDemands demands() const override {
    return {[&] { return limitsOf(options_); },
            {kEnoughPhotos, int64_t{finest_.planes} * finest_.planes / 16},
            finest_.photoBudgetMiB};
  }
  double levelShare() const override { return finest_.levelShare; }
  uint32_t topLevel(const BlockGrid& grid) const override {
    return tessera::topLevel(static_cast<uint32_t>(grid.columns), static_cast<uint32_t>(grid.rows));
  }
  void open(const BlockRun& run, uint32_t) override { finest_.photoBudgetMiB = run.photoBudgetMiB; }
  bool findSettings(const BlockTraining&, const BlockRun&, TrainingLoopOptions&,
                    const std::function<void()>&) override {
    return true;
  }
  std::unique_ptr<Trainee> begin(const BlockTraining& on, const BlockLevel& level) override;
  std::vector<ConfigField> settings() override { return config_.fields(); }
  std::string parts() const override { return fmt::format("{} models", models_); }
  void sayMemory(const BlockTraining& on) const override;
  void stepsAreKnown(int64_t steps) const override;
  int64_t madeFrom(const fs::path& folder) const override { return savedConfig<VolumeConfig>(folder).finestStep; }

 private:
  const TrainVolumeOptions& options_;
  VolumeConfig finest_, config_;            // of the finest level, and of the one that was begun last
  const VolumeTrainer* trainer_ = nullptr;  // of that
  size_t models_ = 0;
};

std::unique_ptr<Trainee> VolumeMethod::begin(const BlockTraining& on, const BlockLevel& level) {
  config_ = finest_;
  if (level.level > 0) {
    config_ = levelConfig(finest_, level.level, level.finestStep);
    config_.residencySteps = std::min(config_.residencySteps, level.steps);  // all blocks get their turn
  }
  auto trainer =
      std::make_unique<VolumeTrainer>(on.device, on.capture, config_, on.grid, level.folder.root() / kWaiting);
  if (level.level > 0 && !level.folder.manifest()) trainer->beginFrom(level.below.root());
  trainer_ = trainer.get();
  models_ = trainer->model().groups().cells.size();
  return trainer;
}

void VolumeMethod::sayMemory(const BlockTraining& on) const {
  const Residency* residency = trainer_->residency();
  MemoryNeeds needs;
  needs.photoBudgetMiB = config_.photoBudgetMiB;
  needs.bytesPerBlock = trainingBytesPerBlock(config_);
  needs.remedy = "use --resident-blocks, or lower texels_per_step or photo_budget_mib";
  if (residency) {
    needs.how = fmt::format(", with {} of {} blocks at a time, {} stays in {} steps", config_.residentBlocks,
                            on.grid.cells(), residency->stays().size(), residency->cycleSteps());
  }
  sayWhatMemoryItTakes(on, options_, needs);
  if (!residency) return;
  const std::vector<uint32_t> never = residency->neverServed();
  if (!never.empty()) {
    const uint32_t columns = static_cast<uint32_t>(on.grid.columns);
    std::vector<std::string> names;
    for (const uint32_t block : never) names.push_back(fmt::format("({}, {})", block % columns, block / columns));
    warn(
        "blocks {} are seen through more than {} blocks at a time wherever they are seen, and will hold nothing; raise "
        "--resident-blocks",
        fmt::join(names, ", "), config_.residentBlocks);
  }
  if (residency->unserved() < kWorthSaying) return;
  warn(
      "{:.0f} % of what the photos show is seen through more than {} blocks, or rare sets of them, and not trained on; "
      "raise --resident-blocks",
      100 * residency->unserved(), config_.residentBlocks);
}

void VolumeMethod::stepsAreKnown(int64_t steps) const {
  const int64_t cycle = trainer_->residency() ? trainer_->residency()->cycleSteps() : 0;
  if (steps >= cycle) return;
  warn(
      "all blocks get their turn in {} steps, and there are {}: some are trained too little, or not at all; train for "
      "longer, raise --resident-blocks, or lower residency_steps",
      cycle, steps);
}

}  // namespace

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
  auto made =
      std::make_unique<VolumeModel>(device, config, requireGrid(model), VolumeModel::Room{residentBlocks, false});
  requireOneFileABlock(folder, manifest, made->space().blocks());
  std::vector<fs::path> files;
  for (const std::string& file : manifest.files) files.push_back(folder / file);
  made->readFrom(std::move(files));
  return made;
}

}  // namespace tessera

// The loop around any representation's training step: number of steps, checkpoints, metrics, progress, stopping.
#pragma once

#include <functional>
#include <optional>

#include "base/safetensors.h"
#include "train/model_folder.h"

namespace tessera {

struct StepReport {
  double loss = 0;
  double squaredError = 0;  // mean over colour channels, for PSNR
  uint32_t rays = 0;
  uint32_t samples = 0;  // that networks were trained on
  uint32_t marched = 0;  // whose density was looked up to find those
  uint32_t texels = 0;   // of virtual grids that the networks were evaluated at; 0 where there are none
};

// One representation in training. The state after a step is a function of the capture, the settings and the step alone.
class Trainee {
 public:
  virtual ~Trainee() = default;
  // `plannedSteps` 0: not known yet.
  virtual StepReport step(int64_t step, int64_t plannedSteps) = 0;
  // Everything that later steps depend on, as one safetensors file a part (a block); and back. `path` is for errors.
  virtual uint32_t parts() const { return 1; }
  virtual Bytes save(uint32_t part) = 0;
  virtual bool isAsSaved(uint32_t) const { return false; }  // nothing of it has changed since the last save or restore
  virtual void restore(uint32_t part, const fs::path& path, const Safetensors& state) = 0;
  // The first part that holds something that is not a number, of what is in memory. Asked before a checkpoint, which
  // must not replace a whole one, and when a loss is not a number.
  virtual std::optional<uint32_t> brokenPart() { return std::nullopt; }
};

// Throws Error when a checkpoint says that it is of another kind; warns when it was trained on another device, which is
// as good, but not the same bits.
void requireFormat(const fs::path& path, const Safetensors& state, const std::string& format,
                   const std::string& method);
void warnOfOtherDevice(const fs::path& path, const Safetensors& state, const std::string& target);

inline constexpr int64_t kDefaultSteps = 10000;

struct TrainingLoopOptions {
  std::string method;
  int64_t steps = 0;   // when no minutes are given; 0: what the run that is resumed had planned, else kDefaultSteps
  double minutes = 0;  // > 0: fixes the number of steps once, early
  double checkpointSeconds = 60;
  bool resume = false;
  bool progress = true;
  std::function<bool()> stopRequested = [] { return false; };  // save and leave
};

struct TrainingResult {
  int64_t step = 0, plannedSteps = 0;
  bool finished = false;
  double seconds = 0, psnr = 0, samplesPerSecond = 0;
};

// Throws Error when the folder holds a model and `resume` is off. Nothing has been touched then.
void refuseTrainedModel(const ModelFolder& folder, const TrainingLoopOptions& options);

// Trains until done, asked to stop, or killed. Throws Error at a loss or a parameter that is not a number (with the
// step; the checkpoint before it stays), and as refuseTrainedModel does.
TrainingResult runTraining(Trainee& trainee, const ModelFolder& folder, const TrainingLoopOptions& options);

}  // namespace tessera

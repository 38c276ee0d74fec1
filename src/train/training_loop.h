// The training loop of all representations: number of steps, checkpoints, metrics, progress, stopping.
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
  uint32_t samples = 0;  // samples that the networks were trained on
  uint32_t marched = 0;  // samples whose density was evaluated to find those
  uint32_t texels = 0;   // texels of virtual grids that the networks were evaluated at; 0 without such grids
};

// A model in training. The state after a step is a function of the capture, the settings and the step alone.
class TrainableModel {
 public:
  virtual ~TrainableModel() = default;
  // Performs one step. `plannedSteps`: the total number of steps, 0 if it is not known yet.
  virtual StepReport step(int64_t step, int64_t plannedSteps) = 0;
  // Save and restore everything that later steps depend on, as one safetensors file per part (a block). `path` is for
  // error messages.
  virtual uint32_t parts() const { return 1; }
  virtual Bytes save(uint32_t part) = 0;
  virtual bool isAsSaved(uint32_t) const { return false; }  // whether it is unchanged since the last save or restore
  virtual void restore(uint32_t part, const fs::path& path, const Safetensors& state) = 0;
  // Returns the first resident part that holds a value that is not finite. Called before a checkpoint, which must not
  // replace an intact one, and when a loss is not finite.
  virtual std::optional<uint32_t> firstNonFinitePart() { return std::nullopt; }
};

// requireFormat throws Error if a checkpoint's metadata names another format. warnOfOtherDevice warns if it was trained
// on another device: the result is as good, but not bit-identical.
void requireFormat(const fs::path& path, const Safetensors& state, const std::string& format,
                   const std::string& method);
void warnOfOtherDevice(const fs::path& path, const Safetensors& state, const std::string& target);

inline constexpr int64_t kDefaultSteps = 10000;

struct TrainingLoopOptions {
  std::string method;
  int64_t steps = 0;   // used without minutes; 0: as the resumed run had planned, else kDefaultSteps
  double minutes = 0;  // > 0: the number of steps is derived from it, once, early in training
  // Between checkpoints. Nothing: a minute, or up to 150 s if a checkpoint takes more than a twentieth of it.
  std::optional<double> checkpointSeconds;
  bool resume = false;
  bool progress = true;
  std::function<bool()> stopRequested = [] { return false; };  // true: save and return
  std::function<void()> saved = [] {};                         // called after each checkpoint
};

struct TrainingResult {
  int64_t step = 0, plannedSteps = 0;
  bool finished = false;
  // Of the steps that were performed now. `psnr`: of the training photos, at the end; none without steps.
  double seconds = 0, samplesPerSecond = 0, samplesPerRay = 0;
  std::optional<double> psnr;
};

// Throws Error if the folder holds a model and `resume` is off. Changes nothing.
void refuseTrainedModel(const ModelFolder& folder, const TrainingLoopOptions& options);

// Trains until all steps are done or a stop is requested. Throws Error, with the step, if a loss or a parameter is not
// finite (the checkpoint before it is kept), if the model has been trained for more than options.steps, and as
// refuseTrainedModel does.
TrainingResult runTraining(TrainableModel& trainable, const ModelFolder& folder, const TrainingLoopOptions& options);

}  // namespace tessera

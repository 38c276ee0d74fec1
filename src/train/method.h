// A method: the functions by which a representation is trained, opened and baked, and its description, as plain data.
// Programs use methods through this interface alone; representations/methods.h lists them all.
#pragma once

#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/check.h"
#include "base/config.h"
#include "compute/device.h"
#include "scene/surface_coverage.h"
#include "scene/view_renderer.h"
#include "train/block_run.h"
#include "train/step_benchmark.h"

namespace tessera {

class Baker;

// The settings of a method's training, type-erased: a struct of its own, with its fields for --help, --set and
// config.toml.
class MethodSettings {
 public:
  virtual ~MethodSettings() = default;
  virtual std::vector<ConfigField> fields() = 0;  // they point into this object
  // Throws Error naming the first setting with an invalid value.
  virtual void check() const = 0;
  // Replaces settings that are `auto` by the values that the resumed run with the settings `run`, of the same method,
  // has tuned. Throws Error if it has not.
  virtual void adoptTunedValues(const MethodSettings& run) = 0;
};

template <class Config>
class SettingsOf final : public MethodSettings {
 public:
  explicit SettingsOf(Config config = {}) : config_(std::move(config)) {}

  std::vector<ConfigField> fields() override { return config_.fields(); }
  void check() const override { config_.check(); }
  void adoptTunedValues([[maybe_unused]] const MethodSettings& run) override {
    if constexpr (requires { config_.adoptTunedValues(config_); }) config_.adoptTunedValues(in(run));
  }

  // Returns the struct inside `settings`, which must be a SettingsOf<Config>.
  static const Config& in(const MethodSettings& settings) {
    const auto* own = dynamic_cast<const SettingsOf*>(&settings);
    CHECK(own != nullptr);
    return own->config_;
  }

 private:
  Config config_;
};

// Implements Method::settings for a struct of settings, with or without presets.
template <class Config>
std::unique_ptr<MethodSettings> makeSettings([[maybe_unused]] const std::string& preset) {
  if constexpr (requires { Config::ofPreset(preset); }) {
    if (!preset.empty()) return std::make_unique<SettingsOf<Config>>(Config::ofPreset(preset));
  }
  return std::make_unique<SettingsOf<Config>>();
}

// Limits a model to what its training photos see, by the rule that limits scenes when they are baked (BakeOptions,
// HashBakeSettings): a cell is kept if a sample in it exceeds both thresholds in a pixel, or if it is beside such a
// cell.
struct CullOptions {
  double minWeight = 0.005, minAlpha = 0.005;  // of a sample: its weight in the pixel, and its opacity
  int dilation = 1;                            // number of layers of cells that are kept around those
  int stride = 1;                              // every stride-th pixel of a photo, along both axes, is looked through
};

// A trained model with its renderer.
class OpenedModel {
 public:
  virtual ~OpenedModel() = default;
  virtual ViewRenderer& renderer() = 0;

  // The following are implemented by methods that count their work along rays (Method::countsSamples).
  struct RayWork {
    // The numbers of densities, and of samples with their colours, that were evaluated so far, cullUnseen included.
    uint64_t densities = 0, samples = 0;
    float minTransmittance = 0;  // rays end where transmittance falls below it
  };
  virtual RayWork rayWork() const { return {}; }
  // Limits the renderer to what the training photos of `capture` see. Throws Error if a mask cannot be read.
  virtual void cullUnseen([[maybe_unused]] const Capture& capture, [[maybe_unused]] const CullOptions& options) {}
};

// A parameter of a method's baker, an integer or a word: a flag of `tessera bake`, for models of this method only.
struct BakeParameter {
  std::string_view name;  // snake_case
  std::string_view help;
  std::span<const std::string_view> choices = {};  // words that stand for 0, 1, …
  int64_t minimum = 0, maximum = 0, divisibleBy = 1;
  std::optional<int64_t> standard = std::nullopt;  // the default; nothing if `help` describes the default behaviour
};
using BakeParameters = std::map<std::string, int64_t, std::less<>>;  // by name; given ones and defaults

// What a method costs on a machine of two cores with AVX-512 if the capture is one block, by order of magnitude:
// measured on a capture of 15 photos of 400×225, `mesh` on one of 72 photos of 400×300 in four blocks. costsOnCapture
// (method_costs.h) returns those of several blocks.
struct MethodCosts {
  double secondsPerStep = 0;
  double raysPerSecond = 0;                // while it trains
  double bakeSeconds = 0;                  // whatever the photos, and
  double secondsPerBakedMegapixel = 0;     // of the training photos
  double secondsPerRenderedMegapixel = 0;  // on the CPU
  int64_t trainBytes = 0;                  // of memory, besides the photos
  int64_t modelBytes = 0;                  // on disk, the scene included
  double coarserLevels = 0;                // time for coarser levels of detail after the finest, as a share of its time
  double secondsPerLaterStep = 0;          // above 0: of steps whose rays have become more, as there is less to sample
};

// A null function means that the method does not support it.
struct Method {
  std::string_view name;        // the value of --method, and in manifest.json
  std::string_view summary;     // one line for --help
  bool trainsInBlocks = false;  // uses all of BlockRunOptions rather than their `loop` alone
  bool swapsBlocks = false;     // can train with only some blocks in memory (the setting resident_blocks)
  bool partsAlone = false;      // trains blocks by themselves, and only some if asked to (BlockRunOptions::only)
  bool countsSamples = false;   // implements OpenedModel::rayWork

  MethodCosts costs;  // for plans of methods that can be baked

  // Returns the default settings, or those of the preset if `preset` names one. Throws Error if there is no such
  // preset. Methods without presets, which have no setting of that name, return their defaults.
  std::unique_ptr<MethodSettings> (*settings)(const std::string& preset) = nullptr;

  // Trains or resumes the model in the folder `model` and saves it; see training_loop.h. Replaces
  // options.loop.method by its own name, for the command in config.toml that reproduces the run. Throws Error before it
  // writes anything if MethodSettings::check rejects `settings`.
  TrainingResult (*train)(Device& device, const Capture& capture, const fs::path& model, const MethodSettings& settings,
                          const BlockRunOptions& options) = nullptr;

  // Returns how such a training would divide a capture that it has not divided before.
  BlockDemand (*blockDemand)(const MethodSettings& settings, const BlockRunOptions& options) = nullptr;

  // Opens the trained model in a folder for rendering. Keeps a reference to `device`. Throws Error if it cannot be
  // read.
  std::unique_ptr<OpenedModel> (*openModel)(Device& device, const fs::path& model) = nullptr;

  // Opens a trained model for baking, with those of its levels that are fully trained. Keeps a reference to `device`.
  // Throws Error if it cannot be read.
  std::unique_ptr<Baker> (*openBaker)(Device& device, const fs::path& model,
                                      const BakeParameters& parameters) = nullptr;
  std::span<const BakeParameter> bakeParameters = {};

  // Returns the sizes of a model with these settings, by the keys of `tessera info`.
  std::vector<std::pair<std::string, uint64_t>> (*describe)(const MethodSettings& settings) = nullptr;

  // Returns how well the surfaces of a trained model cover what its photos show, for the parts of which training has
  // checked it. Throws Error if the model cannot be read.
  std::vector<SurfaceCoverage> (*readCoverage)(const fs::path& model) = nullptr;

  // Times whole training steps on fixed samples.
  StepBenchmark (*benchmarkStep)(Device& device, const StepBenchmarkOptions& options) = nullptr;
};

// An OpenedModel that owns a model and its renderer, which keeps a reference to the model.
template <class Model, class Renderer>
class ModelWithRenderer : public OpenedModel {
 public:
  ModelWithRenderer(std::unique_ptr<Model> model, std::unique_ptr<Renderer> renderer)
      : model_(std::move(model)), renderer_(std::move(renderer)) {}
  Renderer& renderer() override { return *renderer_; }

 protected:
  std::unique_ptr<Model> model_;
  std::unique_ptr<Renderer> renderer_;
};

}  // namespace tessera

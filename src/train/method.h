// A method: what a representation offers to train, open and bake, as plain data and functions. Programs know methods by
// this alone; the table of all is representations/methods.h.
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
#include "scene/view_renderer.h"
#include "train/block_run.h"
#include "train/step_benchmark.h"

namespace tessera {

class Baker;

// The settings of a method's training: a struct of its own, with its fields for --help, --set and config.toml.
class MethodSettings {
 public:
  virtual ~MethodSettings() = default;
  virtual std::vector<ConfigField> fields() = 0;  // of this object; they point into it
  // Throws Error naming the first setting that no model can be made of.
  virtual void check() const = 0;
  // What is to be found out (`auto`) a run that goes on has found, with these settings; they are of the same method.
  // Throws Error when it has not.
  virtual void keepFound(const MethodSettings& run) = 0;
};

template <class Config>
class SettingsOf final : public MethodSettings {
 public:
  explicit SettingsOf(Config config = {}) : config_(std::move(config)) {}

  std::vector<ConfigField> fields() override { return config_.fields(); }
  void check() const override { config_.check(); }
  void keepFound([[maybe_unused]] const MethodSettings& run) override {
    if constexpr (requires { config_.keepFound(config_); }) config_.keepFound(in(run));
  }

  // The struct of settings that this method made.
  static const Config& in(const MethodSettings& settings) {
    const auto* own = dynamic_cast<const SettingsOf*>(&settings);
    CHECK(own != nullptr);
    return own->config_;
  }

 private:
  Config config_;
};

// Method::settings of a struct of settings, with presets or without.
template <class Config>
std::unique_ptr<MethodSettings> makeSettings([[maybe_unused]] const std::string& preset) {
  if constexpr (requires { Config::ofPreset(preset); }) {
    if (!preset.empty()) return std::make_unique<SettingsOf<Config>>(Config::ofPreset(preset));
  }
  return std::make_unique<SettingsOf<Config>>();
}

// A trained model, with what draws it.
class OpenedModel {
 public:
  virtual ~OpenedModel() = default;
  virtual ViewRenderer& renderer() = 0;
  // What its renderer does along rays, of methods that count it (Method::countsSamples).
  struct RayWork {
    uint64_t samples = 0;        // evaluated, of all pictures
    float minTransmittance = 0;  // rays end where less would be seen
  };
  virtual RayWork rayWork() const { return {}; }
};

// A whole number that a method's bakes take: a flag of `tessera bake`, of this method's models only.
struct BakeParameter {
  std::string_view name;  // snake_case
  std::string_view help;
  int64_t least = 0, most = 0, multipleOf = 1;
  std::optional<int64_t> standard = std::nullopt;  // where it is not given; nothing where `help` says what is then
};
using BakeParameters = std::map<std::string, int64_t, std::less<>>;  // by name: those given, and the standard ones

// Functions that are null are not offered.
struct Method {
  std::string_view name;        // as --method has it, and manifest.json
  std::string_view summary;     // in a line, for people
  bool trainsInBlocks = false;  // so that BlockRunOptions count, and not their `loop` alone
  bool swapsBlocks = false;     // trains with some blocks in memory at a time (the setting resident_blocks)
  bool countsSamples = false;   // OpenedModel::rayWork

  // The defaults; of a preset, where `preset` names one. Throws Error when there is no such preset. Methods without
  // presets, which have no setting of that name, give their defaults.
  std::unique_ptr<MethodSettings> (*settings)(const std::string& preset) = nullptr;

  // Trains, resumes, saves; see training_loop.h. Names itself in options.loop.method, for what config.toml says of how
  // to repeat the run. Throws Error before it writes anything where `settings` are refused (MethodSettings::check).
  TrainingResult (*train)(Device& device, const Capture& capture, const fs::path& model, const MethodSettings& settings,
                          const BlockRunOptions& options) = nullptr;

  // A trained model for drawing, from its folder. Keeps a reference to `device`. Throws Error when it cannot be read.
  std::unique_ptr<OpenedModel> (*openModel)(Device& device, const fs::path& model) = nullptr;

  // A trained model for baking, with those of its levels that are trained to their end. Likewise.
  std::unique_ptr<Baker> (*openBaker)(Device& device, const fs::path& model,
                                      const BakeParameters& parameters) = nullptr;
  std::span<const BakeParameter> bakeParameters = {};

  // Numbers that say how large models of these settings are, by the keys of `tessera info`.
  std::vector<std::pair<std::string, uint64_t>> (*describe)(const MethodSettings& settings) = nullptr;

  // Times whole training steps on fixed samples.
  StepBenchmark (*benchmarkStep)(Device& device, const StepBenchmarkOptions& options) = nullptr;
};

// Method::openModel of a model and its renderer, which keeps a reference to it.
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

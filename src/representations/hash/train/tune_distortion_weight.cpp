#include "representations/hash/train/tune_distortion_weight.h"

#include <algorithm>
#include <chrono>
#include <nlohmann/json.hpp>

#include "base/log.h"
#include "scene/block_grid_json.h"

namespace tessera {
namespace {

class ProbeFile {
 public:
  ProbeFile(const fs::path& model, HashConfig config, const BlockTraining& on, const DistortionSearch& probing)
      : path_(distortionFile(model)) {
    settings_ = {{"capture", on.capture.root.string()},
                 {"photos", trainingNames(on.capture)},
                 {"blocks", blockGridToJson(on.grid)},
                 {"minutes", probing.minutes},
                 {"steps", probing.steps}};
    for (const ConfigField& field : config.fields()) settings_[std::string(field.name)] = configValueText(field);
  }

  // Returns the recorded probes if they were run with the same settings, in the order of `weights`.
  DistortionChoice read(const std::vector<double>& weights) const {
    DistortionChoice choice;
    if (!fs::exists(path_)) return choice;
    const nlohmann::json json = nlohmann::json::parse(readTextFile(path_), nullptr, false);
    if (!json.is_object() || json.value("tuned_with_settings", nlohmann::json()) != settings_) return choice;
    try {
      choice.steps = json.at("steps");
      for (const nlohmann::json& probe : json.at("probes")) {
        const size_t next = choice.probes.size();
        if (next == weights.size() || probe.at("distortion") != weights[next]) return {};
        const nlohmann::json& psnr = probe.at("psnr");
        choice.probes.push_back(
            {weights[next], psnr.is_null() ? std::nullopt : std::optional<double>(psnr.get<double>())});
      }
    } catch (const nlohmann::json::exception&) {
      return {};  // the file is malformed
    }
    return choice.steps > 0 ? choice : DistortionChoice();
  }
  void write(const DistortionChoice& choice, std::optional<double> chosen = std::nullopt) const {
    nlohmann::ordered_json json;
    if (chosen) json["chosen"] = *chosen;
    json["steps"] = choice.steps;
    for (const DistortionChoice::Probe& probe : choice.probes) {
      json["probes"].push_back({{"distortion", probe.weight},
                                {"psnr", probe.psnr ? nlohmann::ordered_json(*probe.psnr) : nlohmann::ordered_json()}});
    }
    json["tuned_with_settings"] = settings_;
    writeFileAtomically(path_, json.dump(2) + "\n");
  }

 private:
  fs::path path_;
  nlohmann::json settings_;
};

}  // namespace

fs::path distortionFile(const fs::path& model) {
  return model / "distortion.json";
}

DistortionSearch distortionSearch(const std::string& preset, const TrainingLoopOptions& loop) {
  DistortionSearch probing;
  const double usual = HashConfig::ofPreset(preset).distortionWeight.value();
  probing.weights = {0.1 * usual, 0.3 * usual, usual};
  probing.minSteps = kMinProbeSteps;
  if (loop.minutes > 0) {
    probing.minutes = std::min(kProbeShare * loop.minutes, kMaxProbeMinutes);
    return probing;
  }
  const double steps = static_cast<double>(loop.steps > 0 ? loop.steps : kDefaultSteps);
  probing.steps = std::clamp(static_cast<int64_t>(kProbeShare * steps), kMinProbeSteps, kMaxProbeSteps);
  return probing;
}

bool tuneDistortionWeight(const BlockTraining& on, const fs::path& model, HashConfig& config, TrainingLoopOptions& loop,
                          std::function<void()> begun) {
  DistortionSearch probing = distortionSearch(config.preset, loop);
  const ProbeFile file(model, config, on, probing);
  if (loop.resume) probing.known = file.read(probing.weights);
  probing.progress = loop.progress;
  probing.stopRequested = loop.stopRequested;
  probing.begun = std::move(begun);
  probing.probed = [&](const DistortionChoice& choice) { file.write(choice); };
  const auto start = std::chrono::steady_clock::now();
  const std::optional<DistortionChoice> choice = chooseDistortion(on.device, on.capture, config, on.grid, probing);
  if (!choice) return false;
  config.distortionWeight = choice->weight();
  file.write(*choice, choice->weight());
  if (loop.minutes <= 0) return true;
  const std::chrono::duration<double, std::ratio<60>> spent = std::chrono::steady_clock::now() - start;
  const double left = loop.minutes - spent.count();
  if (left < loop.minutes / 2) {
    warn(
        "determining the weight of the distortion loss took {:.1f} of {} minutes; next time use --set "
        "distortion_weight={}",
        spent.count(), loop.minutes, choice->weight());
  }
  loop.minutes = std::max(0.1 * loop.minutes, left);
  return true;
}

}  // namespace tessera

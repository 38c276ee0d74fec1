#include "apps/viewer/reloading_render_source.h"

#include <fmt/format.h>

#include <chrono>
#include <fstream>
#include <nlohmann/json.hpp>
#include <thread>

#include "base/error.h"

namespace tessera {
namespace {

constexpr int kTries = 5;
constexpr auto kBetweenTries = std::chrono::milliseconds(300);

// Returns the last line of metrics.jsonl that can be parsed; a running training may be writing to the file.
nlohmann::json lastMetrics(const fs::path& path) {
  constexpr std::streamoff kTail = 4096;
  std::ifstream file(path, std::ios::binary | std::ios::ate);
  if (!file) return {};
  const std::streamoff size = file.tellg();
  file.seekg(std::max<std::streamoff>(0, size - kTail));
  nlohmann::json last;
  for (std::string line; std::getline(file, line);) {
    nlohmann::json parsed = nlohmann::json::parse(line, nullptr, false);
    if (parsed.is_object()) last = std::move(parsed);
  }
  return last;
}

}  // namespace

ReloadingRenderSource::ReloadingRenderSource(const fs::path& folder, const DeviceOptions& device,
                                             const RenderSourceOptions& options)
    : folder_(folder), options_(options), device_(makeDevice(device)) {
  if (fs::exists(folder / "blocks.json")) manifest_ = ModelFolder(folder).manifest();
  open();
}

void ReloadingRenderSource::open() {
  renderSource_ = openRenderSource(*device_, folder_, options_);
}

bool ReloadingRenderSource::refresh() {
  if (!manifest_) return false;
  std::optional<ModelManifest> newest;
  try {
    newest = ModelFolder(folder_).manifest();
  } catch (const Error&) {  // its checkpoints are being removed, because there are newer ones
    return false;
  }
  if (!newest || newest->step == manifest_->step) return false;
  renderSource_.reset();  // frees the old one first, because memory may hold only one
  for (int tries = 1; !renderSource_; ++tries) {
    try {
      manifest_ = ModelFolder(folder_).manifest();
      open();
    } catch (const Error&) {  // a newer checkpoint has replaced it
      if (tries == kTries) throw;
      std::this_thread::sleep_for(kBetweenTries);
    }
  }
  return true;
}

FrameSource::Facts ReloadingRenderSource::facts() const {
  FrameSource::Facts facts = {{"Drawn by", renderSource_->renderer().device()}};
  if (!manifest_) return facts;
  facts.emplace_back("Model", manifest_->method);
  facts.emplace_back("Step", manifest_->plannedSteps > 0
                                 ? fmt::format("{} of {}", manifest_->step, manifest_->plannedSteps)
                                 : fmt::format("{}", manifest_->step));
  const nlohmann::json metrics = lastMetrics(ModelFolder(folder_).metricsPath());
  if (metrics.is_object() && metrics.contains("psnr") && metrics["psnr"].is_number()) {
    facts.emplace_back("Training PSNR", fmt::format("{:.2f} dB", metrics["psnr"].get<double>()));
  }
  return facts;
}

}  // namespace tessera

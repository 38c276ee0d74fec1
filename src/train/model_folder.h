// A model on disk: config.toml, blocks.json, blocks/<id>/step-N.safetensors, a manifest written last that names one
// consistent step of all blocks, metrics.jsonl. Killed at any moment it is a complete older model.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <optional>

#include "base/file.h"
#include "train/scene_frame.h"

namespace tessera {

struct ModelManifest {
  std::string method;
  int64_t step = 0;                // steps done
  int64_t plannedSteps = 0;        // 0 while `--minutes` has not fixed it
  std::vector<std::string> files;  // relative, one per block
};

struct ModelPlacement {
  SceneFrame frame;
  Mat4d sourceFromWorld = Mat4d::Identity();  // of the capture: camera paths speak of the source's world
  fs::path capture;
};

class ModelFolder {
 public:
  explicit ModelFolder(fs::path root) : root_(std::move(root)) {}

  const fs::path& root() const { return root_; }
  fs::path configPath() const { return root_ / "config.toml"; }
  fs::path metricsPath() const { return root_ / "metrics.jsonl"; }

  // Nothing when there is no manifest; Error when there is one that cannot be understood or names a missing file.
  std::optional<ModelManifest> manifest() const;
  // One-block models: writes the checkpoint, then the manifest, then removes older checkpoints but the last `keep`.
  void commit(const ModelManifest& state, const Bytes& block, int keep = 2) const;

  // blocks.json: where the model stands, and in whose world.
  void writePlacement(const ModelPlacement& placement, const std::string& method) const;
  ModelPlacement readPlacement() const;

  // The number of steps that `--minutes` came to; kept apart from checkpoints so that it survives a kill before the
  // next.
  void writePlan(int64_t steps) const;
  std::optional<int64_t> readPlan() const;

  // Appends one JSON object as a line. `cutMetrics` drops lines of steps after `step` (what a killed run had done since
  // its last checkpoint).
  void appendMetrics(const nlohmann::json& line) const;
  void cutMetrics(int64_t step) const;

 private:
  fs::path root_;
};

}  // namespace tessera

// A model on disk: config.toml, blocks.json, blocks/<id>/step-N.safetensors, a manifest written last that names one
// consistent step of all blocks, metrics.jsonl. Killed at any moment it is a complete older model.
#pragma once

#include <functional>
#include <nlohmann/json_fwd.hpp>
#include <optional>

#include "base/file.h"
#include "scene/block_grid.h"
#include "train/scene_frame.h"

namespace tessera {

struct ModelManifest {
  std::string method;
  int64_t step = 0;                // steps done
  int64_t plannedSteps = 0;        // 0 while `--minutes` has not fixed it
  std::vector<std::string> files;  // relative, one per block
};

// The number of steps that `--minutes` came to. The steps before `madeAt` were done without knowing it, and are done so
// again when they have to be repeated.
struct StepPlan {
  int64_t steps = 0, madeAt = 0;

  bool operator==(const StepPlan&) const = default;
};

struct ModelPlacement {
  SceneFrame frame;
  std::optional<BlockGrid> grid;              // of models of several blocks; their frame follows from it
  Mat4d sourceFromWorld = Mat4d::Identity();  // of the capture: camera paths speak of the source's world
  fs::path capture;
  std::vector<std::string> trainedOn;  // names of photos, in the capture's order
};

class ModelFolder {
 public:
  explicit ModelFolder(fs::path root) : root_(std::move(root)) {}

  const fs::path& root() const { return root_; }
  fs::path configPath() const { return root_ / "config.toml"; }
  fs::path metricsPath() const { return root_ / "metrics.jsonl"; }

  // Nothing when there is no manifest; Error when there is one that cannot be understood or names a missing file.
  std::optional<ModelManifest> manifest() const;
  // Writes the checkpoints one after another (`save` gives each part's bytes, or nothing where the manifest's file
  // still holds), then the manifest, then removes older checkpoints but the last `keep`.
  void commit(const ModelManifest& state, uint32_t parts,
              const std::function<std::optional<Bytes>(uint32_t part)>& save, int keep = 2) const;

  // blocks.json: where the model stands, and in whose world.
  void writePlacement(const ModelPlacement& placement, const std::string& method) const;
  ModelPlacement readPlacement() const;

  // Kept apart from checkpoints so that it survives a kill before the next.
  void writePlan(const StepPlan& plan) const;
  std::optional<StepPlan> readPlan() const;

  // Appends one JSON object as a line. `cutMetrics` drops lines of steps after `step` (what a killed run had done since
  // its last checkpoint).
  void appendMetrics(const nlohmann::json& line) const;
  void cutMetrics(int64_t step) const;

 private:
  fs::path root_;
};

// The grid of a blocks.json, to cut `capture` by; any JSON object with such a grid will do. Throws Error when the file
// holds none, or says that it lies in another world than the capture's (source_from_world).
BlockGrid readGrid(const fs::path& file, const Capture& capture);

// Throws Error when the capture's world is not the one that the model lies in: poses would mean other places.
void requireSameWorld(const ModelFolder& model, const Capture& capture);
// Throws Error also when the model was trained on other photos.
void requireTrainedOn(const ModelFolder& model, const Capture& capture);
// The photos of `split` that the model was trained on.
std::vector<std::string> trainedOnAmong(const ModelFolder& model, const Capture& capture, Split split);

std::vector<std::string> trainingNames(const Capture& capture);

}  // namespace tessera

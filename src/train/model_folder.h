// A model on disk: config.toml, blocks.json, blocks/<id>/step-N.safetensors, metrics.jsonl, and a manifest, written
// last, that names the checkpoints of one consistent step of all blocks. If the process is killed at any moment, the
// folder holds a complete older model.
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
  int64_t step = 0;          // steps done
  int64_t plannedSteps = 0;  // 0 while it is not yet known, with `--minutes`
  // Checkpoints, relative to the folder, one per block; manifests of a model that consists of models.
  std::vector<std::string> files;
  // Of the steps done, while it is not yet known how many are planned; of these seconds, those that went into
  // checkpoints.
  double seconds = 0, savingSeconds = 0;
  double minutes = 0;  // while the number of steps is not yet known: those of `--minutes`; 0: unknown
};

// The number of steps that was derived from `--minutes`. The steps before `plannedAtStep` were done without knowing it,
// and must be repeated without knowing it for the same result.
struct StepPlan {
  int64_t steps = 0, plannedAtStep = 0;

  bool operator==(const StepPlan&) const = default;
};

struct ModelPlacement {
  SceneFrame frame;
  std::optional<BlockGrid> grid;              // for models in several blocks; it determines their frame
  Mat4d sourceFromWorld = Mat4d::Identity();  // of the capture: camera paths refer to the world of its source
  fs::path capture;
  std::vector<std::string> trainedOn;  // names of photos, in the capture's order
  std::string method = {};             // as it is read; empty: it is not stated
};

class ModelFolder {
 public:
  explicit ModelFolder(fs::path root) : root_(std::move(root)) {}

  const fs::path& root() const { return root_; }
  fs::path configPath() const { return root_ / "config.toml"; }
  fs::path metricsPath() const { return root_ / "metrics.jsonl"; }

  // Returns nothing if there is no manifest. Throws Error if the manifest is malformed or names a missing file.
  std::optional<ModelManifest> manifest() const;
  // Writes the manifest. Throws Error if it cannot be written.
  void writeManifest(const ModelManifest& manifest) const;
  // Writes the checkpoints one after another (`save` returns the bytes of each part, or nothing if the file that the
  // manifest names for it is still current), then the manifest, then removes all but the last `keep` checkpoints of
  // each part.
  void commit(const ModelManifest& state, uint32_t parts,
              const std::function<std::optional<Bytes>(uint32_t part)>& save, int keep = 2) const;

  // Write and read blocks.json: the position of the model, and the world that it refers to. Throw Error if the file
  // cannot be written, or is missing or malformed.
  void writePlacement(const ModelPlacement& placement, const std::string& method) const;
  ModelPlacement readPlacement() const;

  // Write and read plan.json, which is separate from the checkpoints so that it survives if the process is killed
  // before the next one. Throw Error if the file cannot be written or is malformed.
  void writePlan(const StepPlan& plan) const;
  std::optional<StepPlan> readPlan() const;

  // Appends one JSON object as a line to metrics.jsonl. `cutMetrics` removes the lines of steps after `step`, which a
  // killed run wrote after its last checkpoint.
  void appendMetrics(const nlohmann::json& line) const;
  void cutMetrics(int64_t step) const;

 private:
  fs::path root_;
};

// Returns the grid of a blocks.json, to partition `capture` by; any JSON object with such a grid is accepted. Throws
// Error if the file holds none, or if its source_from_world differs from the capture's.
BlockGrid readGrid(const fs::path& file, const Capture& capture);

// Throws Error if the capture's world is not that of the model: its poses would refer to other places.
void requireSameWorld(const ModelFolder& model, const Capture& capture);
// Throws Error as requireSameWorld does, and if the model was trained on other photos.
void requireTrainedOn(const ModelFolder& model, const Capture& capture);
// Returns the names of those photos of `split` that the model was trained on.
std::vector<std::string> trainedOnAmong(const ModelFolder& model, const Capture& capture, Split split);

// Returns the names of the training photos, in the capture's order.
std::vector<std::string> trainingNames(const Capture& capture);

}  // namespace tessera

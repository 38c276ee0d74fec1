#include "representations/mesh/train/train_mesh.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <iterator>
#include <limits>
#include <nlohmann/json.hpp>
#include <optional>

#include "base/error.h"
#include "base/log.h"
#include "representations/mesh/train/coarse_stage.h"
#include "representations/mesh/train/stage_progress.h"
#include "representations/mesh/train/trained_mesh.h"
#include "train/colour_loss.h"
#include "train/run_folder.h"

namespace tessera {
namespace {

constexpr double kTexelsPerCell = 8;  // of a block's finest triangles, along an edge
constexpr double kLeastMinutes = 0.05;

// Returns the minutes from which the training loop derives the number of a block's steps, so that it takes `minutes` in
// the end, coarser levels included. The loop measures the speed early in training, when there are none.
double minutesOfSteps(const MeshConfig& config, double minutes) {
  constexpr double kFitting = 0.4, kLeastShare = 0.8;  // of coarser levels, on two cores
  constexpr double kSlowing = 1.27;                    // by the training of coarser levels, in the end
  if (config.meshLevels == 1) return minutes;
  return config.fitsLevels() ? std::max(kLeastShare * minutes, minutes - kFitting) : minutes / kSlowing;
}

class Stopwatch {
 public:
  double minutes() const {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count() / 60;
  }

 private:
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

BlockLimits makeBlockLimits(const MeshConfig& config) {
  BlockLimits limits;
  limits.texelsPerEdge = static_cast<int>(config.meshCells * kTexelsPerCell);
  limits.memoryBudget = std::numeric_limits<double>::infinity();  // only one block is trained at a time
  return limits;
}

PartitionRequirements partitionRequirements(const MeshConfig& config) {
  return {[&] { return makeBlockLimits(config); },
          {kEnoughPhotos, int64_t{config.meshCells} * config.meshCells},
          config.photoBudgetMiB};
}

constexpr const char* kCoarse = "coarse";

// Parts that have not begun have no record of how long they are to be trained: the run keeps one in run.json. Without
// --steps and --minutes, a resumed run takes them from there. Throws Error if the file is malformed.
void keepLength(const fs::path& model, TrainingLoopOptions& loop) {
  const fs::path file = model / "run.json";
  if (loop.steps > 0 || loop.minutes > 0) {
    const nlohmann::json length = {{"steps", loop.steps}, {"minutes", loop.minutes}};
    writeFileAtomically(file, length.dump(2) + "\n");
    return;
  }
  if (!fs::exists(file)) return;
  const nlohmann::json length = nlohmann::json::parse(readTextFile(file), nullptr, false);
  const auto number = [&](const char* key) {
    if (!length.is_object() || !length.contains(key) || !length[key].is_number() || length[key].get<double>() < 0 ||
        length[key].get<double>() > 1e12) {
      throw Error(file.string(), key, "is missing, or not a number that is possible", "give --steps or --minutes");
    }
    return length[key].get<double>();
  };
  loop.steps = static_cast<int64_t>(number("steps"));
  loop.minutes = number("minutes");
}

// Throws Error if a part that was asked for does not exist.
void requireParts(const std::vector<std::string>& only, const std::vector<MeshPart>& parts) {
  std::string names = kCoarse;
  for (const MeshPart& part : parts) names += ", " + part.name;
  for (const std::string& name : only) {
    const bool exists = name == kCoarse || std::any_of(parts.begin(), parts.end(),
                                                       [&](const MeshPart& part) { return part.name == name; });
    if (!exists) throw Error("--only-blocks " + name, "", "there is no such block", "use some of " + names);
  }
}

// Writes config.toml of a run. With --minutes, each part has a number of steps of its own.
void writeConfig(const Device& device, const fs::path& model, MeshConfig& config, const TrainingLoopOptions& loop) {
  const std::string minutes =
      fmt::format("--minutes {:g}\n# (the steps of each part are in parts/*/manifest.json)", loop.minutes);
  writeFileAtomically(ModelFolder(model).configPath(),
                      reproductionHeader(device, loop, " --grid blocks.json", minutes) + configToToml(config.fields()));
}

// A part that is to be trained, with its share of the time that remains.
struct PlannedPart {
  MeshPart part;
  MeshStart start;
  double share = 0;
};

// Returns the parts that photos show something of, in the order in which they are trained: first the background block.
std::vector<PlannedPart> planParts(const Capture& capture, const std::vector<MeshPart>& parts,
                                   const SurfaceSurvey& survey, const MeshConfig& config) {
  std::vector<PlannedPart> planned;
  std::vector<std::string> empty;
  double blockPixels = 0, backgroundPixels = 0;
  for (const MeshPart& part : parts) {
    PlannedPart plan{part, survey.findStart(part, config.domain(part, 0))};
    if (plan.start.isEmpty()) {
      if (!part.isBackground()) empty.push_back(part.name);
      continue;
    }
    (part.isBackground() ? backgroundPixels : blockPixels) += plan.start.pixels();
    planned.push_back(std::move(plan));
  }
  if (blockPixels == 0) {
    throw Error(capture.root.string(), "transforms.json", "no training photo shows a surface in a block",
                "check the camera poses and the masks");
  }
  if (!empty.empty())
    warn("blocks in which no training photo shows a surface, and which stay empty: {}", fmt::join(empty, ", "));
  constexpr double kLeastShare = 0.03;
  double background = 0;
  if (backgroundPixels > 0) {
    background =
        std::min(config.backgroundShare, std::max(kLeastShare, backgroundPixels / (backgroundPixels + blockPixels)));
  }
  for (PlannedPart& plan : planned)
    plan.share = plan.part.isBackground() ? background : (1 - background) * plan.start.pixels() / blockPixels;
  if (backgroundPixels > 0) std::rotate(planned.begin(), planned.end() - 1, planned.end());
  return planned;
}

// The steps of a part in a run of `steps` for each block; 0: of kDefaultSteps.
int64_t stepsOfPart(const MeshConfig& config, const MeshPart& part, int64_t steps) {
  const int64_t ofBlock = steps > 0 ? steps : kDefaultSteps;
  if (!part.isBackground()) return ofBlock;
  return std::max<int64_t>(1, std::llround(static_cast<double>(ofBlock) * config.backgroundShare));
}

// Whether a finished part would be as long with these options (see runTraining). `steps`: of the part, with --steps.
bool isAsLong(const ModelFolder& folder, int64_t steps, const ModelManifest& manifest,
              const TrainingLoopOptions& options) {
  if (options.minutes > 0) return folder.readPlan().has_value();  // else it has not been trained for minutes yet
  return options.steps == 0 || manifest.step == steps;
}

// Returns the sum of these parts if nothing is left to train of them.
std::optional<TrainingResult> findFinished(const fs::path& model, const std::vector<MeshPart>& parts,
                                           const TrainMeshOptions& options) {
  const std::optional<std::vector<std::string>> shown = readShownParts(model);
  if (!shown) return std::nullopt;
  TrainingResult sum;
  sum.finished = true;
  for (const MeshPart& part : parts) {
    if (std::find(shown->begin(), shown->end(), part.name) == shown->end()) continue;
    const ModelFolder folder = partFolder(model, part);
    const std::optional<ModelManifest> manifest = folder.manifest();
    if (!manifest || manifest->plannedSteps == 0 || manifest->step < manifest->plannedSteps) return std::nullopt;
    if (!isAsLong(folder, stepsOfPart(options.config, part, options.loop.steps), *manifest, options.loop))
      return std::nullopt;
    sum.step += manifest->step;
    sum.plannedSteps += manifest->plannedSteps;
  }
  return sum;
}

// Prepares the folder of a run that begins: removes models of a former run, and nothing else that may be in the folder.
void beginRun(const Device& device, const Capture& given, const BlockRun& run, const std::vector<MeshPart>& parts,
              TrainMeshOptions& options) {
  const fs::path& model = run.folder.root();
  for (const MeshPart& part : parts) removeModel(partFolder(model, part));
  if (!options.loop.resume) {
    removeCoarseStage(model);
    fs::remove(model / "run.json");
  }
  fs::remove(model / "shown.json");
  keepLength(model, options.loop);
  writeConfig(device, model, options.config, options.loop);
  run.folder.writePlacement({{}, run.grid, given.sourceFromWorld, given.root, trainingNames(given)}, "mesh");
  writeMeshManifest(model, parts);  // from now on, --resume takes settings and blocks from this folder
}

// Trains the parts that were asked for, one after another.
class PartsTraining {
 public:
  // `given`: the capture; `capture`: what the parts are trained on (captureOfParts). Holds references to all of them.
  PartsTraining(Device& device, const Capture& given, const Capture& capture, const BlockRun& run,
                const TrainMeshOptions& options, const Stopwatch& stopwatch)
      : device_(device),
        given_(given),
        capture_(capture),
        run_(run),
        model_(run.folder.root()),
        options_(options),
        config_(options.config),
        stopwatch_(stopwatch) {}

  // Throws StageStopped.
  TrainingResult train(const std::vector<MeshPart>& parts) {
    plan(parts);
    std::vector<MeshPart> shown;
    double shareLeft = 0;
    for (const PlannedPart& plan : planned_) {
      shareLeft += plan.share;
      shown.push_back(plan.part);
    }
    writeShownParts(model_, shown);
    const auto saved = [&] { writeMeshManifest(model_, shown); };
    sum_.finished = true;
    for (PlannedPart& plan : planned_) {
      if (!options_.requests(plan.part.name)) continue;
      TrainingLoopOptions loop = planLoop(plan, shareLeft);
      loop.saved = saved;
      shareLeft -= plan.share;
      if (!trainPart(plan, loop)) break;
    }
    sum_.samplesPerSecond = samples_ / std::max(1e-9, sum_.seconds);
    sum_.samplesPerRay = samples_ / std::max(1.0, rays_);
    sum_.seconds = 60 * stopwatch_.minutes();  // with all that comes before the steps of parts
    return sum_;
  }

 private:
  // Vertices start at the surface only in blocks whose training begins now.
  bool startsAtSurface(const MeshPart& part) const {
    return config_.surfaceStart && !part.isBackground() && options_.requests(part.name) &&
           !partFolder(model_, part).manifest();
  }

  void plan(const std::vector<MeshPart>& parts) {
    const auto coarse = loadFieldModel(device_, coarseFolder(model_).root());
    const bool seesPoints =
        std::any_of(parts.begin(), parts.end(), [&](const MeshPart& part) { return startsAtSurface(part); });
    StageProgress progress("looking for surfaces", options_.loop);
    survey_.emplace(capture_, *coarse, seesPoints, progress.onPhoto());
    progress.finish();
    planned_ = planParts(capture_, parts, *survey_, config_);
    survey_->forgetTiles();
    coarseFile_ = coarseFolder(model_).root() / requireManifest(coarseFolder(model_)).files.at(0);
    coarseState_ = readSafetensors(coarseFile_);
  }

  TrainingLoopOptions planLoop(const PlannedPart& plan, double shareLeft) const {
    TrainingLoopOptions loop = options_.loop;
    loop.resume = run_.goesOn || partFolder(model_, plan.part).manifest().has_value();  // also from a plan
    if (loop.minutes > 0) {
      const double left = run_.goesOn || !options_.only.empty()
                              ? (1 - config_.coarseShare) * shareLeft * options_.loop.minutes
                              : options_.loop.minutes - stopwatch_.minutes();
      loop.minutes = std::max(kLeastMinutes, left * plan.share / shareLeft);
      if (!plan.part.isBackground()) loop.minutes = minutesOfSteps(config_, loop.minutes);
    } else if (plan.part.isBackground()) {
      loop.steps = stepsOfPart(config_, plan.part, loop.steps);
    }
    return loop;
  }

  // Returns whether it was trained to its end.
  bool trainPart(PlannedPart& plan, const TrainingLoopOptions& loop) {
    const double pixels = plan.start.pixels(), through = plan.start.through.total();
    if (startsAtSurface(plan.part))
      plan.start.displacements = survey_->findDisplacements(plan.part, config_.domain(plan.part, 0));
    MeshTrainer trainer(device_, capture_, config_, plan.part, std::move(plan.start));
    if (config_.exposure) trainer.useExposures(coarseFile_, coarseState_, given_.photos.size());
    inform("{}: {:.0f} pixels of the photos show it{}", plan.part.name, pixels,
           through > 0 ? fmt::format(", {:.0f} only what is behind it", through) : "");
    const ModelFolder folder = partFolder(model_, plan.part);
    fs::create_directories(folder.root());
    const TrainingResult result = runTraining(trainer, folder, loop);
    addToSum(plan.part, pixels, result);
    return result.finished;
  }

  void addToSum(const MeshPart& part, double pixels, const TrainingResult& result) {
    sum_.step += result.step;
    sum_.plannedSteps += result.plannedSteps;
    sum_.seconds += result.seconds;
    sum_.finished = sum_.finished && result.finished;
    const double samples = result.seconds * result.samplesPerSecond;
    if (samples <= 0) return;  // the part was finished before
    samples_ += samples;
    rays_ += samples / std::max(1e-9, result.samplesPerRay);
    inform("{}: {:.1f} hits a ray, {:.2f} M a second", part.name, result.samplesPerRay, result.samplesPerSecond / 1e6);
    if (part.isBackground() || !result.psnr) return;
    trainedPixels_ += pixels;
    const double before = sum_.psnr.value_or(0);
    sum_.psnr = before + (*result.psnr - before) * pixels / trainedPixels_;  // the mean by pixels
  }

  Device& device_;
  const Capture &given_, &capture_;
  const BlockRun& run_;
  const fs::path& model_;
  const TrainMeshOptions& options_;
  const MeshConfig& config_;
  const Stopwatch& stopwatch_;
  std::optional<SurfaceSurvey> survey_;
  std::vector<PlannedPart> planned_;
  fs::path coarseFile_;
  Safetensors coarseState_;
  TrainingResult sum_;
  double samples_ = 0, rays_ = 0, trainedPixels_ = 0;
};

// Throws StageStopped.
TrainingResult trainAllStages(Device& device, const Capture& given, const fs::path& model, TrainMeshOptions options) {
  const Stopwatch stopwatch;
  MeshConfig& config = options.config;
  config.check();
  colourLossKind(config.loss);  // throws Error
  options.loop.method = "mesh";
  const BlockRun run = openBlockRun(given, model, options, partitionRequirements(config));
  config.photoBudgetMiB = run.photoBudgetMiB;
  const std::vector<MeshPart> parts = makeMeshParts(run.grid, config.hasBackground());
  requireParts(options.only, parts);
  if (run.goesOn) {
    keepLength(model, options.loop);
  } else {
    beginRun(device, given, run, parts, options);
  }
  const TrainingResult coarse = trainCoarseStage(device, given, model, run.grid, config, options.loop);
  const Capture capture = captureOfParts(given, model, config);
  // The budget counts the views between the photos, too, and decides on the order in which photos are drawn.
  const double photoBudgetMiB = resolvePhotoBudget(config.photoBudgetMiB, capture, options.bytesForPhotos());
  if (photoBudgetMiB != config.photoBudgetMiB) {
    config.photoBudgetMiB = photoBudgetMiB;
    writeConfig(device, model, config, options.loop);
  }
  writeMeshManifest(model, parts);
  std::vector<MeshPart> requested;
  std::copy_if(parts.begin(), parts.end(), std::back_inserter(requested),
               [&](const MeshPart& part) { return options.requests(part.name); });
  if (requested.empty()) return coarse;
  if (run.goesOn)
    if (const auto finished = findFinished(model, requested, options)) return *finished;
  return PartsTraining(device, given, capture, run, options, stopwatch).train(parts);
}

}  // namespace

BlockDemand meshBlockDemand(const MeshConfig& config) {
  return {.limits = makeBlockLimits(config)};
}

TrainingResult trainMesh(Device& device, const Capture& capture, const fs::path& model, TrainMeshOptions options) {
  try {
    return trainAllStages(device, capture, model, std::move(options));
  } catch (const StageStopped&) {
    const std::optional<ModelManifest> manifest = ModelFolder(model).manifest();
    if (!manifest) return {};
    return {.step = manifest->step, .plannedSteps = manifest->plannedSteps};
  }
}

}  // namespace tessera

#include "representations/mesh/train/train_mesh.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <bit>
#include <chrono>
#include <cmath>
#include <iterator>
#include <limits>
#include <nlohmann/json.hpp>
#include <optional>

#include "base/error.h"
#include "base/log.h"
#include "representations/field/train/train_field.h"
#include "representations/mesh/train/trained_mesh.h"
#include "representations/mesh/train/transient_masks.h"
#include "representations/mesh/train/views_between.h"
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

// The coarse field needs no details: only where surfaces are, and the exposures of the photos. It grows with the number
// of blocks, so that it can tell their surfaces apart.
FieldConfig coarseConfig(const MeshConfig& config, const BlockGrid& grid) {
  constexpr uint32_t kLeastFinest = 256, kMaxFinest = 2048;
  constexpr uint32_t kLeastLog2Size = 15, kMaxLog2Size = 19, kBlocksOfLeast = 4;
  constexpr int kMaxLongestOfLeast = 4;  // blocks along an edge of the region
  const uint32_t longest = static_cast<uint32_t>(std::max(grid.columns, grid.rows));
  const uint32_t blocks = static_cast<uint32_t>(grid.cells());
  FieldConfig coarse;
  coarse.seed = config.seed;
  coarse.photoBudgetMiB = config.photoBudgetMiB;
  coarse.samplesPerStep = 1 << 15;
  coarse.gridLog2Size = static_cast<int>(
      std::min(kMaxLog2Size, kLeastLog2Size + static_cast<uint32_t>(std::bit_width((blocks - 1) / kBlocksOfLeast))));
  coarse.gridLevels = 8;
  coarse.gridFinest = static_cast<int>(
      std::clamp(std::bit_ceil(static_cast<uint32_t>(config.meshCells) * longest), kLeastFinest, kMaxFinest));
  if (longest > kMaxLongestOfLeast) coarse.occupancyResolution *= 2;
  coarse.exposure = config.exposure;
  coarse.exposureLearningRate = config.exposureLearningRate;
  return coarse;
}

PartitionRequirements partitionRequirements(const MeshConfig& config) {
  return {[&] {
            BlockLimits limits;
            limits.texelsPerEdge = static_cast<int>(config.meshCells * kTexelsPerCell);
            limits.memoryBudget = std::numeric_limits<double>::infinity();  // only one block is trained at a time
            return limits;
          },
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

// Trains the coarse field. Returns false if it was asked to stop.
bool trainCoarseField(Device& device, const Capture& capture, const fs::path& model, const BlockGrid& grid,
                      const TrainMeshOptions& options) {
  const ModelFolder folder = coarseFolder(model);
  FieldConfig coarse = coarseConfig(options.config, grid);
  TrainingLoopOptions loop = options.loop;
  const bool goesOn = folder.manifest().has_value();
  loop.resume = options.loop.resume || goesOn;  // also from a plan before the first checkpoint
  if (loop.minutes > 0) {
    loop.minutes *= options.config.coarseShare;
  } else {
    loop.steps = options.config.coarseSteps;
  }
  if (goesOn) {
    // A finished field stays as it is: parts were trained from it, and other processes may be reading it.
    const ModelManifest manifest = requireManifest(folder, "field");
    if (manifest.plannedSteps > 0 && manifest.step >= manifest.plannedSteps) return true;
    coarse.photoBudgetMiB = savedConfig<FieldConfig>(folder.root()).photoBudgetMiB;
    requireSameConfig(folder.root(), coarse);
  }
  return trainField(device, capture, folder.root(), {coarse, loop}).finished;
}

uint64_t viewSeed(const MeshConfig& config) {
  return static_cast<uint64_t>(config.seed);
}

// Makes what the parts are trained with beside the photos, unless it has been made. Throws StageStopped.
void compareWithCoarseField(Device& device, const Capture& capture, const fs::path& model,
                            const TrainMeshOptions& options) {
  const MeshConfig& config = options.config;
  const bool needsMasks = config.leavesTransientsOut() && !transientFolder(model).isComplete();
  // Without a background block, photos may be transparent, and views by the coarse field are not.
  const bool needsViews = config.enoughPhotos > 0 && config.hasBackground() && !viewsFolder(model).isComplete();
  if (!needsMasks && !needsViews) return;
  const auto coarse = loadFieldModel(device, coarseFolder(model).root());
  if (needsMasks) {
    StageProgress progress("looking for what moves", options.loop);
    makeTransientMasks(capture, *coarse, model, progress.onPhoto());
    progress.finish();
  }
  if (needsViews) {
    StageProgress progress("looking for places in few photos", options.loop);
    makeViewsBetween(capture, *coarse, model, config.enoughPhotos, viewSeed(config), progress.onPhoto());
    progress.finish();
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

// Returns the sum of these parts if nothing is left to train of them.
std::optional<TrainingResult> findFinished(const fs::path& model, const std::vector<MeshPart>& parts,
                                           const TrainMeshOptions& options) {
  const std::optional<std::vector<std::string>> shown = readShownParts(model);
  if (!shown) return std::nullopt;
  TrainingResult sum;
  sum.finished = true;
  for (const MeshPart& part : parts) {
    if (std::find(shown->begin(), shown->end(), part.name) == shown->end()) continue;
    const std::optional<ModelManifest> manifest = partFolder(model, part).manifest();
    if (!manifest || manifest->plannedSteps == 0 || manifest->step < manifest->plannedSteps) return std::nullopt;
    const bool isAsLong = options.loop.minutes > 0 || options.loop.steps == 0 ||
                          manifest->step == stepsOfPart(options.config, part, options.loop.steps);
    if (!isAsLong) return std::nullopt;
    sum.step += manifest->step;
    sum.plannedSteps += manifest->plannedSteps;
  }
  return sum;
}

// Throws StageStopped.
TrainingResult trainCoarseFieldAndParts(Device& device, const Capture& given, const fs::path& model,
                                        TrainMeshOptions options) {
  const Stopwatch stopwatch;
  MeshConfig& config = options.config;
  config.check();
  colourLossKind(config.loss);  // throws Error
  options.loop.method = "mesh";
  const BlockRun run = openBlockRun(given, model, options, partitionRequirements(config));
  config.photoBudgetMiB = run.photoBudgetMiB;
  const std::vector<MeshPart> parts = makeMeshParts(run.grid, config.hasBackground());
  requireParts(options.only, parts);
  if (!run.goesOn) {
    // Models of a former run, and nothing else that may be in the folder.
    const auto removeModel = [](const ModelFolder& folder) {
      if (fs::exists(folder.root() / "manifest.json")) fs::remove_all(folder.root());
    };
    for (const MeshPart& part : parts) removeModel(partFolder(model, part));
    if (!options.loop.resume) removeModel(coarseFolder(model));
    if (!options.loop.resume) transientFolder(model).remove();
    if (!options.loop.resume) viewsFolder(model).remove();
    if (!options.loop.resume) fs::remove(model / "run.json");
    fs::remove(model / "shown.json");
    keepLength(model, options.loop);
    writeConfig(device, model, config, options.loop);
    run.folder.writePlacement({{}, run.grid, given.sourceFromWorld, given.root, trainingNames(given)}, "mesh");
    writeMeshManifest(model, parts);  // from now on, --resume takes settings and blocks from this folder
  } else {
    keepLength(model, options.loop);
  }
  if (!trainCoarseField(device, given, model, run.grid, options)) throw StageStopped();
  compareWithCoarseField(device, given, model, options);
  const Capture capture = addViewsBetween(config.leavesTransientsOut() ? applyTransientMasks(given, model) : given,
                                          model, viewSeed(config));
  // The budget counts the views between the photos, too, and decides on the order in which photos are drawn.
  const double photoBudgetMiB = resolvePhotoBudget(config.photoBudgetMiB, capture, options.bytesForPhotos());
  if (photoBudgetMiB != config.photoBudgetMiB) {
    config.photoBudgetMiB = photoBudgetMiB;
    writeConfig(device, model, config, options.loop);
  }
  writeMeshManifest(model, parts);
  const auto isRequested = [&](const std::string& name) {
    return options.only.empty() || std::find(options.only.begin(), options.only.end(), name) != options.only.end();
  };
  std::vector<MeshPart> requested;
  std::copy_if(parts.begin(), parts.end(), std::back_inserter(requested),
               [&](const MeshPart& part) { return isRequested(part.name); });
  TrainingResult sum;
  sum.finished = true;
  if (requested.empty()) {  // only the coarse field
    const ModelManifest coarse = requireManifest(coarseFolder(model));
    sum.step = coarse.step;
    sum.plannedSteps = coarse.plannedSteps;
    return sum;
  }
  if (run.goesOn)
    if (const auto finished = findFinished(model, requested, options)) return *finished;

  // Vertices start at the surface only in blocks whose training begins now.
  const auto startsAtSurface = [&](const MeshPart& part) {
    return config.surfaceStart && !part.isBackground() && isRequested(part.name) && !partFolder(model, part).manifest();
  };
  std::optional<SurfaceSurvey> survey;
  std::vector<PlannedPart> planned;
  fs::path coarseFile;
  {
    const auto coarse = loadFieldModel(device, coarseFolder(model).root());
    StageProgress progress("looking for surfaces", options.loop);
    survey.emplace(capture, *coarse, std::any_of(parts.begin(), parts.end(), startsAtSurface), progress.onPhoto());
    progress.finish();
    planned = planParts(capture, parts, *survey, config);
    survey->forgetTiles();
    coarseFile = coarseFolder(model).root() / requireManifest(coarseFolder(model)).files.at(0);
  }
  const Safetensors coarseState = readSafetensors(coarseFile);
  double shareLeft = 0, samples = 0, rays = 0, trainedPixels = 0;
  std::vector<MeshPart> shown;
  for (const PlannedPart& plan : planned) {
    shareLeft += plan.share;
    shown.push_back(plan.part);
  }
  writeShownParts(model, shown);
  options.loop.saved = [&] { writeMeshManifest(model, shown); };
  for (PlannedPart& plan : planned) {
    const ModelFolder folder = partFolder(model, plan.part);
    if (!isRequested(plan.part.name)) continue;
    TrainingLoopOptions loop = options.loop;
    loop.resume = run.goesOn || folder.manifest().has_value();  // also from a plan before the first checkpoint
    if (loop.minutes > 0) {
      const double left = run.goesOn || !options.only.empty()
                              ? (1 - config.coarseShare) * shareLeft * options.loop.minutes
                              : options.loop.minutes - stopwatch.minutes();
      loop.minutes = std::max(kLeastMinutes, left * plan.share / shareLeft);
      if (!plan.part.isBackground()) loop.minutes = minutesOfSteps(config, loop.minutes);
    } else if (plan.part.isBackground()) {
      loop.steps = stepsOfPart(config, plan.part, loop.steps);
    }
    shareLeft -= plan.share;
    const double pixels = plan.start.pixels(), through = plan.start.through.total();
    if (startsAtSurface(plan.part))
      plan.start.displacements = survey->findDisplacements(plan.part, config.domain(plan.part, 0));
    MeshTrainer trainer(device, capture, config, plan.part, std::move(plan.start));
    if (config.exposure) trainer.useExposures(coarseFile, coarseState, given.photos.size());
    inform("{}: {:.0f} pixels of the photos show it{}", plan.part.name, pixels,
           through > 0 ? fmt::format(", {:.0f} only what is behind it", through) : "");
    fs::create_directories(folder.root());
    const TrainingResult result = runTraining(trainer, folder, loop);
    sum.step += result.step;
    sum.plannedSteps += result.plannedSteps;
    sum.seconds += result.seconds;
    const double samplesOfPart = result.seconds * result.samplesPerSecond;
    samples += samplesOfPart;
    rays += samplesOfPart / std::max(1e-9, result.samplesPerRay);
    if (samplesOfPart > 0) {  // else the part was finished before
      inform("{}: {:.1f} hits a ray, {:.2f} M a second", plan.part.name, result.samplesPerRay,
             result.samplesPerSecond / 1e6);
    }
    if (!plan.part.isBackground() && samplesOfPart > 0) {
      trainedPixels += pixels;
      sum.psnr += (result.psnr - sum.psnr) * pixels / trainedPixels;  // the mean by pixels
    }
    if (!result.finished) {
      sum.finished = false;
      break;
    }
  }
  sum.samplesPerSecond = samples / std::max(1e-9, sum.seconds);
  sum.samplesPerRay = samples / std::max(1.0, rays);
  sum.seconds = 60 * stopwatch.minutes();  // with all that comes before the steps of parts
  return sum;
}

}  // namespace

TrainingResult trainMesh(Device& device, const Capture& capture, const fs::path& model, TrainMeshOptions options) {
  try {
    return trainCoarseFieldAndParts(device, capture, model, std::move(options));
  } catch (const StageStopped&) {
    TrainingResult reached;
    if (const std::optional<ModelManifest> manifest = ModelFolder(model).manifest()) {
      reached.step = manifest->step;
      reached.plannedSteps = manifest->plannedSteps;
    }
    return reached;
  }
}

}  // namespace tessera

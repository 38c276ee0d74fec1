#include "pipeline/photo_run.h"

#include <fmt/format.h>

#include <algorithm>
#include <functional>
#include <nlohmann/json.hpp>
#include <set>

#include "base/error.h"
#include "base/log.h"
#include "base/order_statistics.h"
#include "base/progress.h"
#include "import/capture_reader.h"
#include "import/georeference.h"
#include "import/importer.h"
#include "photogrammetry/photo_footprints.h"
#include "photogrammetry/photo_list.h"
#include "photogrammetry/photo_masks.h"
#include "photogrammetry/photo_matches.h"
#include "photogrammetry/photo_models.h"
#include "photogrammetry/photo_pairs.h"
#include "pipeline/folder_lock.h"
#include "pipeline/frames_stage.h"
#include "pipeline/georeference_json.h"
#include "pipeline/left_out_json.h"
#include "pipeline/pairs_json.h"
#include "pipeline/posed_source.h"
#include "pipeline/result_digests.h"
#include "pipeline/run_estimator.h"
#include "pipeline/run_report.h"
#include "pipeline/run_request.h"
#include "pipeline/set_aside.h"
#include "pipeline/training_planner.h"
#include "pipeline/verb_process.h"

namespace tessera {
namespace {

constexpr const char* kEvaluatedExposures = "auto";  // of `eval`: predicted from EXIF where they can be

// Whether reading a file throws no Error.
bool isReadable(const std::function<void()>& read) {
  try {
    read();
    return true;
  } catch (const Error&) {
    return false;
  }
}

// Throws Error if photos of a model are not there any more: without them, the capture would silently be smaller.
void requirePhotos(const Capture& capture) {
  for (const Photo& photo : capture.photos) {
    std::error_code status;
    if (fs::exists(photo.image, status)) continue;
    throw Error(photo.image.string(), "", "is not there any more", "bring it back, and run again to go on");
  }
}

bool isOfFrames(const RunPlan::Entry& entry) {
  return entry.stage == "frames";
}

class PhotoRun {
 public:
  explicit PhotoRun(const PhotoRunOptions& options)
      : options_(options),
        posed_(PosedSource::open(options_)),
        planner_(options_, {[this] { return trainingSize(); }, [this] { return captureBeforehand(); },
                            [this] { return downscale(); }, !posed_}) {
    if (posed_) return;
    if (!options_.masks.empty()) masks_.emplace(options_.masks);
    if (masks_ && (liesIn(options_.masks, options_.photos) || liesIn(options_.masks, out("frames")))) {
      throw Error("--masks " + options_.masks.string(), "",
                  "is in the folder of photos: masks would be taken for photos", "move it elsewhere");
    }
    if (options_.holdout == "auto") options_.holdout = "every:8";
    const ColmapSettings colmap{.threads = options.threads};
    matches_ = std::make_unique<PhotoMatches>(out("poses"), list_, colmap);
    models_ = std::make_unique<PhotoModels>(out("poses"), list_, colmap);
    if (fs::is_regular_file(options.photos)) frames_.emplace(options_);
    if (!frames_ || frames_->areComplete()) list();
  }

  // Whether the photos are there, of which all but the frames of a video tells what it will take.
  bool isListed() const { return posed_ || !list_.photos.empty(); }

  std::vector<Stage> stages() {
    const std::string training =
        options_.steps > 0 ? fmt::format("--steps {}", options_.steps) : fmt::format("--minutes {}", options_.minutes);
    std::vector<Stage> stages = {
        {.name = "inspect", .settings = frames_ ? "" : photosDigest_, .run = [this](bool) { return inspect(); }},
        {.name = "features",
         .settings = masks_ ? textDigest(masks_->describe()) : "",
         .isComplete = has("poses/database.db"),
         .discard =
             [this] {
               matches_->discard();
               if (has("poses/adjusted")()) setAside(out("poses"));
             },
         .needs = [this](bool resumes) { return estimator_->featureNeeds(resumes); },
         .run = [this](bool) { return features(); }},
        {.name = "pairs",
         .settings = "",
         .isComplete = has("poses/pairs.json"),
         .needs = [this](bool) { return estimator_->lookAlikeNeeds(); },
         .run = [this](bool) { return pairs(); }},
        {.name = "matches",
         .settings = "",
         .isComplete = has("poses/database.db"),
         .discard = [this] { matches_->discardMatches(); },
         .needs = [this](bool resumes) { return estimator_->matchNeeds(resumes); },
         .run = [this](bool) { return matches(); }},
        {.name = "mapping",
         .settings = "",
         .isComplete = has("poses/sparse"),
         .discard = [this] { models_->discardMapped(); },
         .needs = [this](bool) { return estimator_->matchingNeeds().mapping; },
         .run = [this](bool resumes) { return mapping(resumes); }},
        {.name = "remapping",
         .settings = "",
         .discard = [this] { models_->discardJoined(); },
         .needs = [this](bool) { return remappingNeeds(); },
         .run = [this](bool resumes) { return remapping(resumes); }},
        {.name = "adjusting",
         .settings = "",
         .isComplete = has("poses/adjusted"),
         .discard = [this] { models_->discardAdjusted(); },
         .needs = [this](bool) { return estimator_->matchingNeeds().adjusting; },
         .run = [this](bool) { return adjusting(); }},
        {.name = "georeferencing", .settings = "", .run = [this](bool) { return georeferencing(); }},
        {.name = "capture",
         // The size that was chosen stays the same on another machine.
         .settings = (options_.downscale > 0 ? std::to_string(options_.downscale)
                                             : fmt::format("for {} {}", options_.method, training)) +
                     " " + describeHoldOut(options_.holdout) + (posed_ ? " " + posed_->digest() : ""),
         .isComplete = has("capture/transforms.json"),
         .needs = [this](bool resumes) { return planner_.captureNeeds(resumes); },
         .run = [this](bool) { return capture(); }},
        {.name = "train",
         .settings = fmt::format("--method {} {}", options_.method, training),
         .isComplete = has("model/manifest.json"),
         .discard = [this] { setAside(out("model")); },
         .needs =
             [this](bool resumes) {
               planner_.expectNewModel();
               return planner_.trainNeeds(resumes);
             },
         .run = [this](bool) { return train(); }},
        {.name = "bake",
         .settings = "",
         .inputs = [this] { return modelDigest(out("model")); },
         .isComplete = has("scene/tileset.json"),
         .needs = [this](bool) { return planner_.needs().bake; },
         .run = [this](bool) { return bake(); }},
        {.name = "evaluate",
         .settings = std::string("--exposure ") + kEvaluatedExposures,
         .inputs = [this] { return sceneDigest(out("scene")); },
         .isComplete = [this] { return !hasHoldOut() || (has("eval.json")() && has("evaluation.html")()); },
         .needs = [this](bool) { return planner_.needs().evaluate; },
         .run = [this](bool) { return evaluate(); }},
        {.name = "report",
         .settings = frames_ ? "" : leftOutDigest(list_.leftOut),
         .isComplete = has("report.html"),
         .run = [this](bool) { return report(); }},
    };
    const auto isCapture = [](const Stage& stage) { return stage.name == "capture"; };
    if (posed_) stages.erase(stages.begin(), std::find_if(stages.begin(), stages.end(), isCapture));
    if (frames_) addFrames(stages);
    return stages;
  }

 private:
  // Puts the stage `frames` before the others, whose photos, and settings that depend on them, follow from it.
  void addFrames(std::vector<Stage>& stages) {
    for (Stage& stage : stages)
      stage.needs = [this, needs = stage.needs](bool resumes) { return isListed() ? needs(resumes) : StageNeeds{}; };
    Stage frames = frames_->stage();
    frames.revealsNeeds = true;
    frames.run = [this, take = frames.run](bool resumes) {
      std::string summary = take(resumes);
      list();
      RunPlan plan = planStages(options_.out, this->stages(), options_.range);
      std::erase_if(plan.entries, isOfFrames);
      announcePlan(plan, options_.out);
      return summary;
    };
    stages.insert(stages.begin(), std::move(frames));
  }

  void list() {
    const fs::path folder = frames_ ? frames_->folder() : options_.photos;
    ThreadPool pool(options_.threads);
    list_ = listPhotos(folder, pool);
    warnLeftOut(list_.leftOut);
    if (list_.photos.size() < 3) {
      throw Error(folder.string(), "",
                  fmt::format("holds {} photos that can be used; poses need three", list_.photos.size()),
                  "name a folder of JPEG or PNG photos, or a video");
    }
    photosDigest_ = photosDigest(list_.photos);
    planner_.photosAreListed();
    if (masks_) masks_->addTo(list_);
    estimator_ = std::make_unique<RunEstimator>(options_, list_, *matches_, photosDigest_);
  }

  fs::path out(const char* name) const { return options_.out / name; }
  std::function<bool()> has(const char* name) const {
    return [file = out(name)] {
      std::error_code status;
      return fs::exists(file, status);
    };
  }

  fs::path pairsFile() const { return out("poses/pairs.json"); }
  fs::path leftOutFile() const { return out("poses/left_out.json"); }
  fs::path georeferenceFile() const { return out("poses/georeference.json"); }

  void stopIfInterrupted() const {
    if (options_.interrupted()) throw RunInterrupted();
  }
  PhotoMatches::Watch watch(Progress& progress) const {
    return [this, &progress](int64_t done) {
      progress.update(done);
      stopIfInterrupted();
    };
  }

  // The import may drop the photos that are to be held out: the capture decides, if it is there.
  bool hasHoldOut() const {
    try {
      if (has("capture/transforms.json")()) return !readCapture(out("capture")).photosIn(Split::test).empty();
    } catch (const Error&) {  // damaged: it will be written again, or evaluation says so
    }
    return posed_ ? posed_->holdsOut() : options_.holdout != "none";
  }

  std::string inspect() {
    size_t withGps = 0;
    for (const ListedPhoto& photo : list_.photos) withGps += photo.tags.gps ? 1 : 0;
    return fmt::format("{} photos, {} with GPS, {} left out; {} cameras, {} flights", list_.photos.size(), withGps,
                       list_.leftOut.size(), list_.bodies.size(), list_.flights);
  }

  std::string features() {
    Progress progress("features", static_cast<int64_t>(list_.photos.size()), "photos");
    matches_->extractFeatures(watch(progress));
    const auto photos = static_cast<size_t>(matches_->count().photos);
    const size_t all = list_.photos.size();
    return photos < all ? fmt::format("{} of {} photos", photos, all) : fmt::format("{} photos", all);
  }

  std::string pairs() {
    LookAlikes lookAlikes;
    if (const std::vector<int> photos = photosForLookAlikes(list_); !photos.empty()) {
      try {
        inform("GPS does not tell what {} photos show: those that look like them are searched for", photos.size());
        lookAlikes = matches_->findLookAlikes(photos, [this](int64_t) { stopIfInterrupted(); });
      } catch (const ColmapKilled&) {
        stopIfInterrupted();
        throw;
      } catch (const Error& error) {
        stopIfInterrupted();
        warn("photos that GPS does not place are only compared with those before and after them: {}", error.what());
      }
    }
    const ChosenPairs chosen{photosDigest_, choosePairs(list_, lookAlikes), lookAlikes};
    writePairs(pairsFile(), chosen);
    estimator_->setPairs(chosen.pairs.size());
    return fmt::format("{} of {}", chosen.pairs.size(), list_.photos.size() * (list_.photos.size() - 1) / 2);
  }

  std::string matches() {
    const std::vector<PhotoPair> chosen = readPairs(pairsFile(), list_.photos.size()).pairs;
    Progress progress("matches", static_cast<int64_t>(chosen.size()), "pairs");
    matches_->match(chosen, watch(progress));
    const size_t linked = matches_->linkedPairs();
    return fmt::format("{} of {} pairs show the same places", linked, chosen.size());
  }

  std::string placedText(size_t unplaced) const {
    return fmt::format("{} of {} photos", list_.photos.size() - unplaced, list_.photos.size());
  }

  std::string mapping(bool resumes) {
    Progress progress("mapping", static_cast<int64_t>(list_.photos.size()), "photos");
    models_->map(resumes, watch(progress));
    const PhotoModels::Count count = models_->countMapped();
    std::string summary = placedText(list_.photos.size() - count.photos);
    if (count.models > 1) summary += fmt::format(", in {} models", count.models);
    return summary;
  }

  int join() {
    try {
      return models_->join([this](int64_t) { stopIfInterrupted(); });
    } catch (const ColmapKilled&) {
      stopIfInterrupted();
      throw;
    } catch (const Error& error) {
      stopIfInterrupted();
      warn("models that share photos are not joined: {}", error.what());
      return 0;
    }
  }

  // Nothing as long as there is no model that could lack photos.
  StageNeeds remappingNeeds() {
    if (!has("poses/sparse")()) return {};
    try {
      const std::vector<int> missing = models_->unplaced();
      if (missing.empty()) return {};
      const LookAlikes lookAlikes = readPairs(pairsFile(), list_.photos.size()).lookAlikes;
      return estimator_->remappingNeeds(missing.size(), chooseMorePairs(list_, lookAlikes, missing).size());
    } catch (const Error&) {  // of other photos, or damaged: they are written again before
      return {};
    }
  }

  // A second round for what the first has left.
  std::string remapping(bool resumes) {
    const bool wasJoined = resumes && has("poses/joined")();
    const int joined = wasJoined ? 0 : join();
    const std::vector<int> missing = models_->unplaced();
    if (missing.empty() && joined == 0 && !wasJoined) return "not needed";
    if (!missing.empty()) {
      inform("{} photos could not be placed; they are compared with more of the others", missing.size());
      try {
        Progress progress("remapping", static_cast<int64_t>(list_.photos.size()), "photos");
        const LookAlikes lookAlikes = readPairs(pairsFile(), list_.photos.size()).lookAlikes;
        matches_->match(chooseMorePairs(list_, lookAlikes, missing), [this](int64_t) { stopIfInterrupted(); });
        models_->extend(resumes, watch(progress));
      } catch (const ColmapKilled&) {
        stopIfInterrupted();
        throw;
      } catch (const Error& error) {
        stopIfInterrupted();
        warn("no photos could be added: {}", error.what());
      }
    }
    std::string summary = placedText(models_->unplaced().size());
    if (wasJoined) summary += ", models joined before";
    if (joined > 0) summary += fmt::format(", {} models joined with the largest", joined);
    return summary;
  }

  std::string adjusting() {
    models_->adjust([this](int64_t) { stopIfInterrupted(); });
    const std::vector<LeftOutPhoto> unplaced = matches_->explain(models_->unplaced(), models_->placedApart());
    warnLeftOut(unplaced);
    writeLeftOut(leftOutFile(), unplaced);
    return placedText(unplaced.size());
  }

  std::string georeferencing() {
    const SourceCapture source = models_->read();
    std::string reason;
    const auto fit = georeference(source.capture.photos, source.flight, reason);
    writeGeoreference(georeferenceFile(), fit, reason, source);
    if (!fit) return "none: " + reason;
    if (const std::string text = describeDisagreeing(readGeoreference(georeferenceFile())); !text.empty())
      warn("{}", text);
    if (fit->isBent()) {
      warn(
          "the heights of GPS bend by {:.1f} m ± {:.1f} m from the middle of the photos to the farthest: the poses "
          "form a {}; photos that look aslant, or lines that cross at another height, prevent it",
          fit->bend->metres, fit->bend->error, fit->bend->metres > 0 ? "dome" : "bowl");
    }
    return fmt::format("{} of {} GPS fixes agree; standard errors: {:.2f} % of the scale, {:.2f}°, {:.2f} m",
                       fit->inliers, fit->fixes, 100 * fit->scaleError, fit->rotationError, fit->middleError);
  }

  int downscale() const {
    if (options_.downscale > 0) return options_.downscale;
    return chooseDownscale(posed_ ? posed_->trainingSize() : estimator_->trainingSize(), options_.costs);
  }

  TrainingSize trainingSize() {
    return posed_ ? posed_->trainingSize(downscale()) : estimator_->trainingSize(downscale());
  }
  std::optional<Capture> captureBeforehand() const { return posed_ ? posed_->capture() : captureFromTags(list_); }

  std::string capture() {
    SourceCapture source = posed_ ? posed_->take(out("poses")) : models_->read();
    if (!posed_) requirePhotos(source.capture);
    std::set<std::string> dropped;
    const Capture capture = importSource(std::move(source), options_.photos.string(), out("capture"),
                                         {.downscale = downscale(),
                                          .holdout = options_.holdout,
                                          .threads = options_.threads,
                                          .look = [this] { stopIfInterrupted(); },
                                          .dropped = [&](const std::set<std::string>& names) { dropped = names; }});
    planner_.captureIsWritten();
    addLeftOut(leftOutFile(), dropped, "damaged: it ends early, or cannot be decoded");
    const std::string size = downscale() > 1 ? fmt::format(", made smaller by {}", downscale()) : "";
    return fmt::format("{} photos, {} held out{}{}", capture.photos.size(), capture.photosIn(Split::test).size(),
                       capture.geo ? ", georeferenced" : "", size);
  }

  std::string train() {
    std::vector<std::string> arguments{out("capture").string(), out("model").string(), "--method", options_.method,
                                       "--resume"};
    if (options_.steps > 0) {
      arguments.insert(arguments.end(), {"--steps", std::to_string(options_.steps)});
    } else {
      arguments.insert(arguments.end(), {"--minutes", fmt::format("{}", options_.minutes)});
    }
    inform("to watch the training: tail -f {}", (options_.out / "logs" / "train.log").string());
    checkRoom({{{"train", planner_.trainNeeds(true)}, {"bake", planner_.needs().bake}}}, options_.out);
    std::string summary = runVerb(options_, "train", arguments);
    planner_.modelIsTrained();
    return summary;
  }

  std::string bake() {
    // Written in this way, a name may begin with a dash.
    const std::string name = "--name=" + fs::weakly_canonical(options_.out).filename().string();
    return runVerb(options_, "bake",
                   {out("model").string(), out("scene").string(), "--capture", out("capture").string(), name});
  }

  std::string evaluate() {
    if (!hasHoldOut()) return "no photo is held out";
    runVerb(options_, "eval",
            {out("scene").string(), out("capture").string(), "--json", out("eval.json").string(), "--report",
             out("evaluation.html").string(), "--exposure", kEvaluatedExposures});
    const auto result = nlohmann::json::parse(readTextFile(out("eval.json")));
    // It has none if the views show nothing that is compared.
    if (!result.is_object() || !result.contains("psnr") || !result["psnr"].is_number())
      return "no held-out PSNR: the views show nothing that is compared";
    const std::string exposure = result.value("exposure", "neutral");
    return fmt::format("held-out PSNR {:.2f} dB{}", result["psnr"].get<double>(),
                       exposure == "neutral" ? "" : ", exposures " + exposure);
  }

  // What only the report reads, and folders of earlier versions lack, is not worth training again.
  void restoreReported() {
    const bool hasLeftOut = isReadable([&] { readLeftOut(leftOutFile()); });
    const bool hasGeoreference = isReadable([&] { readGeoreference(georeferenceFile()); });
    if (hasLeftOut && hasGeoreference) return;
    if (posed_) {
      posed_->take(out("poses"));
      return;
    }
    if (!hasLeftOut) writeLeftOut(leftOutFile(), matches_->explain(models_->unplaced(), models_->placedApart()));
    if (!hasGeoreference) georeferencing();
  }

  std::string report() {
    restoreReported();
    const fs::path folder = fs::absolute(options_.photos / "").lexically_normal().parent_path();
    writeFileAtomically(out("report.html"), runReport(options_.out, {.title = folder.filename().string(),
                                                                     .method = options_.method,
                                                                     .photos = posed_ ? posed_->photos() : list_.photos,
                                                                     .leftOut = list_.leftOut,
                                                                     .hasEvaluation = hasHoldOut()}));
    inform("to look at the scene: tessera serve {}", out("scene").string());
    return out("report.html").string();
  }

  PhotoRunOptions options_;
  std::optional<PosedSource> posed_;
  std::optional<PhotoMasks> masks_;    // of photos without poses
  std::optional<VideoPhotos> frames_;  // of a video
  PhotoList list_;                     // of a video: empty until its frames are there
  std::string photosDigest_;           // of its photos
  std::unique_ptr<PhotoMatches> matches_;
  std::unique_ptr<PhotoModels> models_;
  std::unique_ptr<RunEstimator> estimator_;
  TrainingPlanner planner_;
};

}  // namespace

void runFromPhotos(const PhotoRunOptions& options) {
  requireUsableRequest(options);
  const FolderLock lock(options.out);
  claimFolder(options.out);
  PhotoRun run(options);
  const std::vector<Stage> stages = run.stages();
  RunPlan plan = planStages(options.out, stages, options.range);
  if (!run.isListed()) {
    inform("what the stages after `frames` take is known when the frames are there");
    std::erase_if(plan.entries, std::not_fn(isOfFrames));
  }
  if (options.dryRun) fmt::print("{}", describePlan(plan));
  announcePlan(plan, options.out, run.isListed() ? "this" : "frames");
  if (options.dryRun) return;
  runStages(options.out, describeRequest(options), stages, options.range, [&] {
    if (options.interrupted()) throw RunInterrupted();
  });
}

}  // namespace tessera

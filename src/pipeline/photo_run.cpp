#include "pipeline/photo_run.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "base/child_process.h"
#include "base/error.h"
#include "base/log.h"
#include "base/progress.h"
#include "import/holdout.h"
#include "import/importer.h"
#include "photogrammetry/photo_list.h"
#include "photogrammetry/photo_pairs.h"
#include "photogrammetry/reconstruction.h"
#include "pipeline/folder_lock.h"

namespace tessera {
namespace {

using Json = nlohmann::ordered_json;

class PhotoRun {
 public:
  explicit PhotoRun(const PhotoRunOptions& options) : options_(options) {
    ThreadPool pool(options.threads);
    list_ = listPhotos(options.photos, pool);
    if (list_.photos.size() < 3) {
      throw Error(options.photos.string(), "",
                  fmt::format("holds {} photos that can be used; poses need three", list_.photos.size()),
                  "name a folder of JPEG or PNG photos");
    }
    warnLeftOut(list_.leftOut);
    reconstruction_ =
        std::make_unique<Reconstruction>(out("poses"), list_, ReconstructionOptions{.threads = options.threads});
  }

  std::vector<Stage> stages() {
    const std::string training =
        options_.steps > 0 ? fmt::format("--steps {}", options_.steps) : fmt::format("--minutes {}", options_.minutes);
    return {
        {.name = "inspect", .settings = describePhotos(), .run = [this](bool) { return inspect(); }},
        {.name = "features",
         .settings = "",
         .isComplete = has("poses/database.db"),
         .discard = [this] { reconstruction_->discardFeatures(); },
         .run = [this](bool) { return features(); }},
        {.name = "pairs",
         .settings = "",
         .isComplete = has("poses/pairs.json"),
         .run = [this](bool) { return pairs(); }},
        {.name = "matches",
         .settings = "",
         .isComplete = has("poses/database.db"),
         .run = [this](bool) { return matches(); }},
        {.name = "mapping",
         .settings = "",
         .isComplete = has("poses/sparse"),
         .run = [this](bool resumes) { return mapping(resumes); }},
        {.name = "capture",
         .settings = fmt::format("{} {}", downscale(), options_.holdout),
         .isComplete = has("capture/transforms.json"),
         .run = [this](bool) { return capture(); }},
        {.name = "train",
         .settings = fmt::format("--method {} {}", options_.method, training),
         .isComplete = has("model/manifest.json"),
         .discard = [this] { setModelAside(); },
         .run = [this](bool) { return train(); }},
        {.name = "bake",
         .settings = "",
         .isComplete = has("scene/tileset.json"),
         .run = [this](bool) { return bake(); }},
        {.name = "evaluate",
         .settings = "",
         .isComplete = [this] { return options_.holdout == "none" || has("eval.json")(); },
         .run = [this](bool) { return evaluate(); }},
    };
  }

 private:
  fs::path out(const char* name) const { return options_.out / name; }
  std::function<bool()> has(const char* name) const {
    return [file = out(name)] {
      std::error_code status;
      return fs::exists(file, status);
    };
  }

  std::string describePhotos() const {
    std::string text;
    for (const ListedPhoto& photo : list_.photos) {
      std::error_code status;
      text += fmt::format("{} {} {}\n", photo.name, fs::file_size(photo.file, status),
                          fs::last_write_time(photo.file, status).time_since_epoch().count());
    }
    return textDigest(text);
  }

  StageOutcome inspect() {
    size_t withGps = 0;
    for (const ListedPhoto& photo : list_.photos) withGps += photo.tags.gps ? 1 : 0;
    return {0, fmt::format("{} photos, {} with GPS, {} left out; {} cameras, {} flights", list_.photos.size(), withGps,
                           list_.leftOut.size(), list_.bodies.size(), list_.flights)};
  }

  StageOutcome features() {
    Progress progress("features", static_cast<int64_t>(list_.photos.size()), "photos");
    reconstruction_->extractFeatures([&](int64_t done) { progress.update(done); });
    return {reconstruction_->peakBytes(), fmt::format("{} photos", list_.photos.size())};
  }

  StageOutcome pairs() {
    const std::vector<PhotoPair> chosen = choosePairs(list_);
    writeFileAtomically(out("poses/pairs.json"), Json(chosen).dump());
    return {0, fmt::format("{} of {}", chosen.size(), list_.photos.size() * (list_.photos.size() - 1) / 2)};
  }

  StageOutcome matches() {
    const std::vector<PhotoPair> chosen = choosePairs(list_);
    Progress progress("matches", static_cast<int64_t>(chosen.size()), "pairs");
    reconstruction_->match(chosen, [&](int64_t done) { progress.update(done); });
    const size_t linked = reconstruction_->linkedPairs();
    return {reconstruction_->peakBytes(), fmt::format("{} of {} pairs show the same places", linked, chosen.size())};
  }

  StageOutcome mapping(bool resumes) {
    Progress progress("mapping", static_cast<int64_t>(list_.photos.size()), "photos");
    reconstruction_->map(resumes, [&](int64_t done) { progress.update(done); });
    if (const std::vector<int> missing = reconstruction_->unplacedPhotos(); !missing.empty()) {
      inform("{} photos could not be placed; they are compared with more of the others", missing.size());
      reconstruction_->match(chooseMorePairs(list_, missing), [](int64_t) {});
      reconstruction_->extendMap([&](int64_t done) { progress.update(done); });
    }
    const std::vector<LeftOutPhoto> unplaced = reconstruction_->unplaced();
    warnLeftOut(unplaced);
    return {reconstruction_->peakBytes(),
            fmt::format("{} of {} photos", list_.photos.size() - unplaced.size(), list_.photos.size())};
  }

  int downscale() const {
    if (options_.downscale > 0) return options_.downscale;
    int longest = 1;
    for (const CameraBody& body : list_.bodies) longest = std::max({longest, body.width, body.height});
    return (longest + kLongestSide - 1) / kLongestSide;
  }

  StageOutcome capture() {
    const Capture capture =
        importSource(reconstruction_->largestModel(), options_.photos.string(), out("capture"),
                     {.downscale = downscale(), .holdout = options_.holdout, .threads = options_.threads});
    return {0, fmt::format("{} photos, {} held out{}", capture.photos.size(), capture.photosIn(Split::test).size(),
                           capture.geo ? ", georeferenced" : "")};
  }

  // Runs a verb of this program; its output is in logs/VERB.log, and the end of it on a terminal meanwhile.
  StageOutcome runVerb(const std::string& verb, std::vector<std::string> arguments) {
    std::error_code status;
    fs::create_directories(out("logs"), status);
    const fs::path log = options_.out / "logs" / (verb + ".log");
    arguments.insert(arguments.begin(), {options_.program, verb});
    if (options_.threads > 0) arguments.insert(arguments.end(), {"--threads", std::to_string(options_.threads)});
    ChildProcess process;
    const std::string failure = process.start(arguments, {.log = log});
    if (!failure.empty()) throw Error(options_.program, "", "cannot be run: " + failure, "install it again");
    const std::string end = process.wait();
    const std::string words = process.lastWords();
    const std::string line = words.substr(words.rfind('\n') == words.npos ? 0 : words.rfind('\n') + 1);
    if (!end.empty())
      throw Error("tessera " + verb, "", end + ": " + line, "see " + log.string() + "; run again to go on");
    return {process.peakBytes(), line};
  }

  // A model that was trained on something else or in another way is kept beside the new one.
  void setModelAside() {
    std::error_code status;
    if (!fs::exists(out("model"), status)) return;
    fs::path earlier = out("model.earlier");
    for (int i = 2; fs::exists(earlier, status); ++i) earlier = out("model.earlier-") += std::to_string(i);
    fs::rename(out("model"), earlier, status);
    if (status) throw Error(out("model").string(), "", "cannot be renamed: " + status.message(), "check the disk");
    inform("{} is kept as {}", out("model").string(), earlier.string());
  }

  StageOutcome train() {
    std::vector<std::string> arguments{out("capture").string(), out("model").string(), "--method", options_.method,
                                       "--resume"};
    if (options_.steps > 0) {
      arguments.insert(arguments.end(), {"--steps", std::to_string(options_.steps)});
    } else {
      arguments.insert(arguments.end(), {"--minutes", fmt::format("{}", options_.minutes)});
    }
    return runVerb("train", arguments);
  }

  StageOutcome bake() {
    return runVerb("bake", {out("model").string(), out("scene").string(), "--capture", out("capture").string()});
  }

  StageOutcome evaluate() {
    if (options_.holdout == "none") return {0, "no photo is held out"};
    StageOutcome outcome = runVerb("eval", {out("scene").string(), out("capture").string(), "--json",
                                            out("eval.json").string(), "--report", out("report.html").string()});
    const Json result = Json::parse(readTextFile(out("eval.json")));
    outcome.summary =
        fmt::format("held-out PSNR {:.2f} dB; {}", result.value("psnr", 0.0), out("report.html").string());
    return outcome;
  }

  PhotoRunOptions options_;
  PhotoList list_;
  std::unique_ptr<Reconstruction> reconstruction_;
};

}  // namespace

void runFromPhotos(const PhotoRunOptions& options) {
  std::error_code status;
  if (!fs::is_directory(options.photos, status))
    throw Error(options.photos.string(), "", "is not a folder", "name a folder of photos");
  const fs::path inside = fs::weakly_canonical(fs::absolute(options.out))
                              .lexically_relative(fs::weakly_canonical(fs::absolute(options.photos)));
  if (!inside.empty() && *inside.begin() != "..") {
    throw Error(options.out.string(), "", "is the folder of photos, or in it: its pictures would be taken for photos",
                "name another folder to write to");
  }
  checkHoldOut(options.holdout);
  for (const char* name : {"poses", "capture", "model", "scene"}) {
    if (!fs::exists(options.out / name, status) || fs::exists(options.out / "run.json", status)) continue;
    throw Error((options.out / name).string(), "", "was not made by such a run, and would be replaced",
                "name another folder to write to");
  }
  const FolderLock lock(options.out);
  PhotoRun run(options);
  runStages(options.out, fmt::format("run {} {}", options.photos.string(), options.out.string()), run.stages(),
            options.range);
}

}  // namespace tessera

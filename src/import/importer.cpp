#include "import/importer.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <mutex>
#include <optional>
#include <set>

#include "base/error.h"
#include "base/image_io.h"
#include "base/log.h"
#include "base/progress.h"
#include "import/clean.h"
#include "import/colmap_model.h"
#include "import/holdout.h"
#include "import/mask_command.h"
#include "import/orient_world.h"
#include "import/photo_files.h"
#include "import/picture_origins.h"
#include "import/transforms_json.h"
#include "scene/capture_writer.h"

namespace tessera {
namespace {

// The numbers of photos in a folder and its subfolders, by whether their format is supported.
struct PhotoCount {
  size_t readable = 0, convertible = 0;  // JPEG and PNG; formats that other programs convert to JPEG
  std::string firstConvertible;          // extension of the first such file, in its original spelling
};

PhotoCount countPhotos(const fs::path& folder) {
  constexpr size_t kMaxEntries = 100000;  // the folder may be the root of a disk
  constexpr int kDeepest = 4;
  PhotoCount count;
  std::error_code status;
  fs::recursive_directory_iterator at(folder, fs::directory_options::skip_permission_denied, status), end;
  for (size_t entries = 0; !status && at != end && entries < kMaxEntries; at.increment(status), ++entries) {
    if (at.depth() >= kDeepest) at.disable_recursion_pending();
    const std::string spelling = at->path().extension().string();
    std::string extension = spelling;
    std::transform(extension.begin(), extension.end(), extension.begin(),
                   [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
    const auto hasExtension = [&extension](std::initializer_list<const char*> names) {
      return std::find(names.begin(), names.end(), extension) != names.end();
    };
    count.readable += hasExtension({".jpg", ".jpeg", ".png"});
    if (!hasExtension({".tif", ".tiff", ".heic", ".heif", ".webp", ".dng"})) continue;
    if (count.convertible++ == 0) count.firstConvertible = spelling;
  }
  return count;
}

// Returns the path quoted as one word for a POSIX shell.
std::string shellWord(const fs::path& path) {
  const std::string text = path.string();
  const bool plain = std::all_of(text.begin(), text.end(), [](unsigned char c) {
    return std::isalnum(c) || std::string_view("/._-+,:@%").find(static_cast<char>(c)) != std::string_view::npos;
  });
  if (plain && !text.empty()) return text;
  std::string word = "'";
  for (const char c : text) word += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return word + "'";
}

[[noreturn]] void refuse(const fs::path& source) {
  std::error_code status;
  if (!fs::exists(source, status)) throw Error(source.string(), "", "does not exist", "name a folder of posed photos");
  const fs::path images = fs::is_directory(source / "images", status) ? source / "images" : source;
  const PhotoCount photos = countPhotos(images);
  if (photos.readable > 0) {
    throw Error(
        source.string(), "", fmt::format("contains {} photos but no camera poses", photos.readable),
        fmt::format("{}tessera run {} OUT finds their poses, and trains",
                    photos.convertible > 0 ? fmt::format("convert the {} others ({}) to JPEG if they are wanted; ",
                                                         photos.convertible, photos.firstConvertible)
                                           : "",
                    shellWord(images)));
  }
  if (photos.convertible > 0) {
    throw Error(source.string(), "",
                fmt::format("contains {} photos ({}), but photos must be JPEG or PNG", photos.convertible,
                            photos.firstConvertible),
                "convert them to JPEG of full size and best quality, with their EXIF data, then import again");
  }
  throw Error(source.string(), "", "is not a COLMAP model (sparse/0 and images) and contains no transforms.json",
              "name the folder that holds one of them");
}

// Assigns unique paths in the capture: images/a.jpg and images/a.png, both downscaled to PNG, become a.png and
// a.png.png.
class Names {
 public:
  std::string unique(std::string folder, fs::path name, const std::string& extension) {
    if (name.is_absolute() || std::find(name.begin(), name.end(), "..") != name.end()) name = name.filename();
    const fs::path first = *name.begin();
    if (first == folder && std::distance(name.begin(), name.end()) > 1) name = name.lexically_relative(first);
    const std::string full = folder + "/" + name.generic_string();
    std::string candidate = fs::path(full).replace_extension(extension).generic_string();
    if (used_.contains(candidate)) candidate = full + extension;
    for (int i = 2; used_.contains(candidate); ++i) candidate = fmt::format("{}_{}{}", full, i, extension);
    used_.insert(candidate);
    return candidate;
  }

 private:
  std::set<std::string> used_;
};

struct Size {
  int width, height;
};

Size reduced(const PhotoFacts& facts, int downscale) {
  const auto side = [downscale](int pixels) {
    return std::max(1, static_cast<int>(std::lround(double(pixels) / downscale)));
  };
  return {side(facts.width), side(facts.height)};
}

// Gives every photo the camera of its downscaled size, and scales the observations accordingly.
void scaleCameras(Capture& capture, const std::vector<PhotoFacts>& facts, int downscale) {
  if (downscale == 1) return;
  std::vector<Camera> cameras;
  std::vector<std::pair<float, float>> factors;
  for (size_t i = 0; i < capture.photos.size(); ++i) {
    Photo& photo = capture.photos[i];
    const Size size = reduced(facts[i], downscale);
    const Camera& camera = capture.cameras[static_cast<size_t>(photo.camera)];
    factors.emplace_back(static_cast<float>(size.width) / static_cast<float>(camera.width),
                         static_cast<float>(size.height) / static_cast<float>(camera.height));
    const Camera scaled = camera.scaledTo(size.width, size.height);
    const auto match = std::find(cameras.begin(), cameras.end(), scaled);
    photo.camera = static_cast<int>(match - cameras.begin());
    if (match == cameras.end()) cameras.push_back(scaled);
  }
  capture.cameras = std::move(cameras);
  for (Observation& observation : capture.observations) {
    const auto [x, y] = factors[observation.photo];
    observation.x *= x;
    observation.y *= y;
    observation.error *= (x + y) / 2;
  }
}

struct Outcomes {
  std::vector<FileOutcome> photos;
  std::vector<std::string> withoutMask, withoutDepth;
};

// Makes the masks of all imported photos that are not ready. A program may take all cores and much memory, so one runs
// at a time.
void runMaskCommand(SourceCapture& source, const std::vector<fs::path>& targets, const std::string& text,
                    Outcomes& outcomes) {
  const MaskCommand command(text);
  std::vector<Photo>& photos = source.capture.photos;
  Progress progress("masks", static_cast<int64_t>(photos.size()), "photos");
  constexpr size_t kFirst = 20;  // photos, after which it is likely that all masks will exclude everything
  size_t masks = 0, excluded = 0;
  for (size_t i = 0; i < photos.size(); ++i) {
    if (outcomes.photos[i] != FileOutcome::ready) continue;
    const ImageInfo image = probeImageFile(photos[i].image);
    if (!isReady(photos[i].image, targets[i], image.width, image.height)) {
      std::optional<ImageU8> other;
      if (!photos[i].mask.empty()) {
        other = readMask(photos[i].mask, image.width, image.height, source.maskIsInverted[i]);
        if (!other) outcomes.withoutMask.push_back(photos[i].name);
      }
      command.makeMask(photos[i].image, targets[i], other.value_or(ImageU8()));
    }
    photos[i].mask = targets[i];
    if (masks++ < kFirst) excluded += excludesAll(readImage(targets[i]).image) ? 1 : 0;
    if (masks == kFirst && excluded == kFirst)
      warn("the masks of the first {} photos exclude all their pixels: white is what is used", kFirst);
    progress.update(static_cast<int64_t>(i) + 1);
  }
  progress.finish();
}

// Imports all images, masks and depth maps. The paths in Photo point into the capture afterwards.
Outcomes importPictures(SourceCapture& source, const std::vector<PhotoFacts>& facts, const fs::path& out,
                        const ImportOptions& options, double scale, ThreadPool& pool) {
  std::vector<Photo>& photos = source.capture.photos;
  std::vector<fs::path> imageTargets, maskTargets, depthTargets;
  Names names;
  PictureOrigins origins;
  for (size_t i = 0; i < photos.size(); ++i) {
    const Size size = reduced(facts[i], options.downscale);
    std::string extension = photos[i].image.extension().string();
    if (options.downscale > 1) {
      const bool lossless = int64_t{size.width} * size.height <= kLosslessPixels || facts[i].isPng;
      extension = lossless ? ".png" : ".jpg";
    }
    const fs::path original = photos[i].name;
    photos[i].name = names.unique("images", original, extension);
    imageTargets.push_back(out / photos[i].name);
    const fs::path inner = fs::path(photos[i].name).lexically_relative("images");
    if (options.downscale > 1 && fs::weakly_canonical(photos[i].image) == fs::weakly_canonical(out / photos[i].name)) {
      throw Error(out.string(), "", "holds the photos themselves: reduced ones would take their place",
                  "name another folder to write to");
    }
    const std::string mask = names.unique("masks", inner, ".png");
    maskTargets.push_back(out / mask);
    const std::string how = fmt::format("{} x {}", size.width, size.height);
    origins.add(photos[i].name, photos[i].image, how);
    const bool hasMask = !photos[i].mask.empty();
    if (hasMask && !options.maskCommand.empty() &&
        fs::weakly_canonical(photos[i].mask) == fs::weakly_canonical(out / mask)) {
      throw Error(out.string(), "", "holds the masks of the source: those of --mask-command would take their place",
                  "name another folder to write to");
    }
    const std::string conversion = how + (hasMask && source.maskIsInverted[i] ? ", inverted" : "");
    if (!options.maskCommand.empty()) {
      const std::string other = hasMask ? ", and " + describeFile(photos[i].mask) : "";
      origins.add(mask, photos[i].image, conversion + ", masked by " + options.maskCommand + other);
    } else if (hasMask) {
      origins.add(mask, photos[i].mask, conversion);
    }
    depthTargets.push_back(out / names.unique("depths", inner, ".exr"));
  }
  // While images change, the folder is not a complete capture.
  std::error_code status;
  const bool isCapture = fs::exists(out / "transforms.json", status);
  if (!isCapture) origins.requireOwn(out);
  fs::remove(out / "transforms.json", status);
  origins.claim(out);
  Outcomes outcomes{std::vector<FileOutcome>(photos.size(), FileOutcome::ready), {}, {}};
  Progress progress("import", static_cast<int64_t>(photos.size()), "photos");
  std::mutex mutex;
  int64_t done = 0;
  pool.run(photos.size(), [&](size_t i, int) {
    options.look();
    Photo& photo = photos[i];
    const Size size = reduced(facts[i], options.downscale);
    outcomes.photos[i] = importPhoto(photo.image, imageTargets[i], size.width, size.height);
    bool maskOk = true, depthOk = true;
    if (outcomes.photos[i] == FileOutcome::ready) {
      photo.image = imageTargets[i];
      if (!photo.mask.empty() && options.maskCommand.empty()) {
        maskOk = importMask(photo.mask, maskTargets[i], size.width, size.height, source.maskIsInverted[i]) ==
                 FileOutcome::ready;
        photo.mask = maskOk ? maskTargets[i] : fs::path();
      }
      if (!photo.depth.empty()) {
        depthOk = importDepth(photo.depth, depthTargets[i], size.width, size.height,
                              {photo.depthUnit, scale * source.exrUnit[i]}) == FileOutcome::ready;
        photo.depth = depthOk ? depthTargets[i] : fs::path();
      }
    }
    const std::lock_guard lock(mutex);
    if (!maskOk) outcomes.withoutMask.push_back(photo.name);
    if (!depthOk) outcomes.withoutDepth.push_back(photo.name);
    progress.update(++done);
  });
  progress.finish();
  if (!options.maskCommand.empty()) runMaskCommand(source, maskTargets, options.maskCommand, outcomes);
  return outcomes;
}

// Throws Error if no pixel of any photo is left; then removes masks that a program has made, which would be taken for
// those of the program when it has been corrected.
void checkMasks(const std::vector<Photo>& photos, const fs::path& out, bool areMade, ThreadPool& pool) {
  std::vector<char> areExcluded(photos.size(), 0);
  pool.run(photos.size(), [&](size_t i, int) {
    if (!photos[i].mask.empty()) areExcluded[i] = excludesAll(readImage(photos[i].mask).image) ? 1 : 0;
  });
  std::vector<std::string> excluded;
  for (size_t i = 0; i < photos.size(); ++i)
    if (areExcluded[i] != 0) excluded.push_back(photos[i].name);
  std::error_code status;
  if (areMade && excluded.size() == photos.size())
    for (const Photo& photo : photos) fs::remove(photo.mask, status);
  warnOfExcluded(excluded, photos.size(), out / "masks");
}

// Sets the exposures of photos whose source does not know them, from EXIF. Nothing is set if most have no tags.
void setExposures(Capture& capture, const std::vector<PhotoFacts>& facts) {
  std::vector<ExposureTags> tags;
  for (size_t i = 0; i < capture.photos.size(); ++i) {
    if (capture.photos[i].exposure) return;
    tags.push_back(facts[i].tags.exposure);
  }
  const std::vector<std::optional<double>> stops = comparableStops(tags);
  double sum = 0;
  int count = 0;
  for (const std::optional<double>& one : stops) {
    if (!one) continue;
    sum += *one;
    ++count;
  }
  if (2 * count < static_cast<int>(stops.size())) return;
  for (size_t i = 0; i < stops.size(); ++i)
    if (stops[i]) capture.photos[i].exposure = *stops[i] - sum / count;
  inform("exposures of {} of {} photos by EXIF", count, stops.size());
}

// Names the files of the source: those of the capture may have other names.
void dropFailed(SourceCapture& source, const Outcomes& outcomes) {
  std::vector<std::string> truncated, unreadable;
  std::vector<size_t> usable;
  for (size_t i = 0; i < outcomes.photos.size(); ++i) {
    switch (outcomes.photos[i]) {
      case FileOutcome::ready:
        usable.push_back(i);
        break;
      case FileOutcome::truncated:
        truncated.push_back(source.capture.photos[i].image.string());
        break;
      case FileOutcome::unreadable:
        unreadable.push_back(source.capture.photos[i].image.string());
        break;
    }
  }
  warnDropped(truncated, "end early (truncated)");
  warnDropped(unreadable, "cannot be decoded");
  if (!outcomes.withoutMask.empty()) {
    warn("{} masks are missing or unreadable, and have no effect ({}, ...)", outcomes.withoutMask.size(),
         outcomes.withoutMask[0]);
  }
  if (!outcomes.withoutDepth.empty()) {
    warn("{} depth maps are missing or unreadable ({}, ...)", outcomes.withoutDepth.size(), outcomes.withoutDepth[0]);
  }
  if (usable.size() < outcomes.photos.size()) keepPhotos(source, usable);
}

}  // namespace

std::string sourceFormat(const fs::path& source) {
  if (const auto files = findTransforms(source); !files.empty()) return files[0].filename().string();
  if (findColmapModel(source)) return "COLMAP model";
  return "";
}

SourceCapture readSourceCapture(const fs::path& source) {
  if (const auto files = findTransforms(source); !files.empty()) return readTransforms(files);
  if (findColmapModel(source)) return readColmap(source);
  refuse(source);
}

Capture importCapture(const fs::path& sourcePath, const fs::path& out, const ImportOptions& options) {
  if (options.downscale < 1 || options.downscale > 64) {
    throw Error("--downscale", std::to_string(options.downscale), "is not from 1 to 64", "use 1, 2, 4 or 8");
  }
  std::error_code status;
  if (fs::weakly_canonical(sourcePath) == fs::weakly_canonical(out)) {
    throw Error(out.string(), "", "is the source itself", "name another folder to write to");
  }
  for (const fs::path& file : findTransforms(sourcePath)) {
    if (fs::equivalent(file, out / "transforms.json", status))
      throw Error(out.string(), "", "holds the source, which would be replaced", "name another folder to write to");
  }
  checkHoldOut(options.holdout);
  if (!options.maskCommand.empty()) MaskCommand{options.maskCommand};  // throws Error if it is malformed
  return importSource(readSourceCapture(sourcePath), sourcePath.string(), out, options);
}

Capture importSource(SourceCapture source, const std::string& from, const fs::path& out, const ImportOptions& options) {
  std::error_code status;
  ThreadPool pool(options.threads);
  if (options.holdout == "auto" && source.splitError) throw *source.splitError;
  if (holdsPosesOfOthers(out)) {
    throw Error((out / "transforms.json").string(), "", "was not written by an import, and would be lost",
                "name another folder to write to");
  }
  std::set<std::string> dropped;
  for (const Photo& photo : source.capture.photos) dropped.insert(photo.name);
  const std::vector<PhotoFacts> facts = cleanSource(source, pool);
  Capture& capture = source.capture;
  if (capture.photos.empty()) {
    throw Error(from, "", "no photo of it can be used", "see the warnings above");
  }

  requireUtf8Names(capture.photos);

  std::vector<UprightTags> tags;
  for (size_t i = 0; i < facts.size(); ++i) {
    int& orientation = capture.photos[i].orientation;
    if (orientation == 1) orientation = facts[i].tags.orientation;
    tags.push_back({facts[i].tags.gimbal, orientation});
  }
  const Orientation orientation = orientWorld(source, tags);
  inform("{} photos, {} points; {}", capture.photos.size(), capture.points.size(), orientation.how);

  setExposures(capture, facts);
  scaleCameras(capture, facts, options.downscale);
  fs::create_directories(out, status);
  std::vector<std::string> names;  // the capture has others
  for (const Photo& photo : capture.photos) names.push_back(photo.name);
  const Outcomes outcomes = importPictures(source, facts, out, options, orientation.scale, pool);
  for (size_t i = 0; i < names.size(); ++i)
    if (outcomes.photos[i] == FileOutcome::ready) dropped.erase(names[i]);
  options.dropped(dropped);
  dropFailed(source, outcomes);
  if (capture.photos.empty()) {
    throw Error(from, "", "no photo of it can be decoded", "see the warnings above");
  }
  checkMasks(capture.photos, out, !options.maskCommand.empty(), pool);
  chooseSplit(source, options.holdout);
  capture.root = out;
  writeCapture(capture);
  return std::move(capture);
}

}  // namespace tessera

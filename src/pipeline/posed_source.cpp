#include "pipeline/posed_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <set>

#include "base/error.h"
#include "base/file_digest.h"
#include "base/image_io.h"
#include "base/log.h"
#include "base/order_statistics.h"
#include "import/clean.h"
#include "import/georeference.h"
#include "import/holdout.h"
#include "import/importer.h"
#include "import/orient_world.h"
#include "photogrammetry/photo_masks.h"
#include "pipeline/georeference_json.h"
#include "pipeline/left_out_json.h"
#include "pipeline/run_request.h"

namespace tessera {
namespace {

std::string describe(const Capture& capture) {
  std::string text = fmt::format("{} points, {} observations\n", capture.points.size(), capture.observations.size());
  const auto describeMatrix = [&text](const Mat4d& matrix) {
    for (int i = 0; i < 16; ++i) text += fmt::format(" {}", matrix(i / 4, i % 4));
    text += "\n";
  };
  describeMatrix(capture.sourceFromWorld);
  if (capture.geo) {
    text += fmt::format("{} {} {}", capture.geo->latitude, capture.geo->longitude, capture.geo->altitude);
    describeMatrix(capture.geo->enuFromWorld);
  }
  for (const Camera& camera : capture.cameras) {
    text += fmt::format("{} {}x{}", static_cast<int>(camera.lens), camera.width, camera.height);
    for (const double parameter : camera.parameters) text += fmt::format(" {}", parameter);
    text += "\n";
  }
  for (const Photo& photo : capture.photos) {
    const Pose& pose = photo.worldFromCamera;
    text += fmt::format("{} {} {} {} {}", photo.name, photo.camera, static_cast<int>(photo.split),
                        photo.exposure.value_or(0), photo.depthUnit);
    for (int i = 0; i < 3; ++i)
      for (int k = 0; k < 3; ++k) text += fmt::format(" {}", pose.rotation(i, k));
    for (int i = 0; i < 3; ++i) text += fmt::format(" {}", pose.translation[i]);
    if (photo.gps) {
      text += fmt::format(" {} {} {} {}", photo.gps->latitude, photo.gps->longitude, photo.gps->altitude,
                          photo.gps->relativeAltitude);
    }
    for (const fs::path& file : {photo.image, photo.mask, photo.depth}) text += " " + fileDigest(file);
    text += "\n";
  }
  Vec3d sum = Vec3d::Zero();
  for (const SparsePoint& point : capture.points) sum += point.xInWorld;
  return textDigest(text + fmt::format("{} {} {}", sum.x(), sum.y(), sum.z()));
}

// `readable`: the photos of the source that the import does not drop.
int64_t countHeldOut(const SourceCapture& source, std::vector<Photo> readable, const std::string& rule) {
  if (rule == "auto" && source.splitError) throw *source.splitError;
  SourceCapture copy;
  copy.capture.photos = std::move(readable);
  copy.hasOwnSplit = source.hasOwnSplit;
  chooseSplit(copy, rule);
  return static_cast<int64_t>(copy.capture.photosIn(Split::test).size());
}

}  // namespace

std::optional<PosedSource> PosedSource::open(const PhotoRunOptions& options) {
  const std::string format = sourceFormat(options.photos);
  if (format.empty()) return std::nullopt;
  if (options.frames > 0) throw Error("--frames", "", "concerns videos, and this is none", "leave it out");
  if (liesIn(options.photos, options.out / "capture")) {
    throw Error(options.photos.string(), "", "is the capture that would be written",
                "name another folder to write to, or the photos that it was made from");
  }
  inform("{} has poses ({}): the stages that find them are left out", options.photos.string(), format);
  return PosedSource(options);
}

PosedSource::PosedSource(const PhotoRunOptions& options)
    : options_(&options), source_(readSourceCapture(options.photos)) {
  if (!options.masks.empty()) PhotoMasks(options.masks).addTo(source_);
  const Capture& capture = source_.capture;
  std::string flags;
  for (const bool isInverted : source_.maskIsInverted) flags += isInverted ? '1' : '0';
  for (const double unit : source_.exrUnit) flags += fmt::format(" {}", unit);
  digest_ = textDigest(describe(capture) + flags + (source_.hasOwnSplit ? " split" : ""));
  std::vector<int> sides;
  std::vector<int64_t> pixels;
  std::vector<Photo> readable;
  for (const Photo& photo : capture.photos) {
    photos_.push_back({.name = photo.name, .file = photo.image});
    std::error_code status;
    const auto bytes = fs::file_size(photo.image, status);
    size_.sourceBytes += status ? 0 : static_cast<int64_t>(bytes);
    int width = 0, height = 0;
    try {
      const ImageInfo image = probeImageFile(photo.image);
      width = image.width;
      height = image.height;
      readable.push_back(photo);
      pictureSizes_.emplace_back(width, height);
    } catch (const Error&) {  // it will be left out
      pictureSizes_.emplace_back(0, 0);
      if (static_cast<size_t>(photo.camera) >= capture.cameras.size()) continue;
      width = capture.cameras[static_cast<size_t>(photo.camera)].width;
      height = capture.cameras[static_cast<size_t>(photo.camera)].height;
    }
    sides.push_back(std::max(width, height));
    pixels.push_back(int64_t{width} * height);
  }
  if (sides.empty()) throw Error(options.photos.string(), "", "no photo of it can be used", "see the warnings above");
  size_.photos = static_cast<int64_t>(photos_.size());
  size_.photoPixels = size_.sourcePixels = upperMedian(pixels);
  size_.longerSide = upperMedian(sides);
  size_.minutes = options.minutes;
  size_.steps = options.steps;
  size_.heldOut = countHeldOut(source_, std::move(readable), options.holdout);
}

SourceCapture PosedSource::take(const fs::path& poses) {
  ThreadPool pool(options_->threads);
  std::set<std::string> missing;
  for (const Photo& photo : source_.capture.photos) missing.insert(photo.name);
  cleanSource(source_, pool);
  for (const Photo& photo : source_.capture.photos) missing.erase(photo.name);
  std::vector<LeftOutPhoto> leftOut;
  for (const std::string& name : missing)
    leftOut.push_back({name, "missing or unreadable, or of another shape than its camera"});
  std::string reason;
  const auto fit = georeference(source_.capture.photos, source_.flight, reason);
  writeGeoreference(poses / "georeference.json", fit, reason, source_);
  writeLeftOut(poses / "left_out.json", leftOut);
  return std::move(source_);
}

TrainingSize PosedSource::trainingSize(int downscale) const {
  TrainingSize size = size_;
  size.photoPixels /= int64_t{downscale} * downscale;
  size.threads = options_->threads;
  size.isLinked = downscale == 1 && areOnOneDisk(options_->photos, options_->out);
  return size;
}

Capture PosedSource::capture() const {
  SourceCapture copy = source_;
  copy.flight.clear();
  copy.capture.photos.clear();
  copy.capture.cameras.clear();
  std::vector<Camera>& cameras = copy.capture.cameras;
  for (size_t i = 0; i < source_.capture.photos.size(); ++i) {
    Photo photo = source_.capture.photos[i];
    const auto [width, height] = pictureSizes_[i];
    if (width == 0 || static_cast<size_t>(photo.camera) >= source_.capture.cameras.size()) continue;
    const Camera camera = source_.capture.cameras[static_cast<size_t>(photo.camera)].scaledTo(width, height);
    const auto match = std::find(cameras.begin(), cameras.end(), camera);
    photo.camera = static_cast<int>(match - cameras.begin());
    if (match == cameras.end()) cameras.push_back(camera);
    copy.capture.photos.push_back(std::move(photo));
  }
  if (!copy.capture.photos.empty()) orientWorld(copy, {});
  return std::move(copy.capture);
}

}  // namespace tessera

#include "import/clean.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <set>

#include "base/error.h"
#include "base/file.h"
#include "base/image_io.h"
#include "base/log.h"
#include "base/readable_file.h"

namespace tessera {
namespace {

PhotoFacts readPhotoFacts(const Photo& photo) {
  PhotoFacts facts;
  if (!isReadableFile(photo.image)) return facts;
  const Bytes head = readPhotoHead(photo.image);
  const auto info = probeImage(head);
  if (!info || info->format == ImageInfo::Format::exr) return facts;
  facts.width = info->width;
  facts.height = info->height;
  facts.isPng = info->format == ImageInfo::Format::png;
  facts.tags = decodePhotoTags(head);
  return facts;
}

// Resizing preserves the aspect ratio to within the rounding of one pixel on each side.
bool sameShape(const Camera& camera, int width, int height) {
  const double scale = static_cast<double>(width) / camera.width;
  return std::abs(camera.height * scale - height) <= 1 + scale;
}

}  // namespace

std::string abbreviateList(const std::vector<std::string>& names) {
  std::string first;
  for (size_t i = 0; i < names.size() && i < 3; ++i) first += (i > 0 ? ", " : "") + names[i];
  return names.size() > 3 ? first + ", ..." : first;
}

void warnDropped(const std::vector<std::string>& names, const std::string& what) {
  if (names.empty()) return;
  warn("{} photo{} {}; dropped ({})", names.size(), names.size() > 1 ? "s" : "", what, abbreviateList(names));
}

void keepPhotos(SourceCapture& source, const std::vector<size_t>& order) {
  Capture& capture = source.capture;
  std::vector<Photo> photos;
  std::vector<bool> inverted;
  std::vector<double> exrUnit;
  std::vector<int> flight;
  std::vector<int> newIndex(capture.photos.size(), -1);
  std::vector<int> newCamera(capture.cameras.size(), -1);
  std::vector<Camera> cameras;
  for (const size_t old : order) {
    newIndex[old] = static_cast<int>(photos.size());
    photos.push_back(std::move(capture.photos[old]));
    inverted.push_back(old < source.maskIsInverted.size() && source.maskIsInverted[old]);
    exrUnit.push_back(old < source.exrUnit.size() ? source.exrUnit[old] : 1);
    if (!source.flight.empty()) flight.push_back(source.flight[old]);
    auto& camera = newCamera[static_cast<size_t>(photos.back().camera)];
    if (camera < 0) {
      camera = static_cast<int>(cameras.size());
      cameras.push_back(capture.cameras[static_cast<size_t>(photos.back().camera)]);
    }
    photos.back().camera = camera;
  }
  capture.photos = std::move(photos);
  capture.cameras = std::move(cameras);
  source.maskIsInverted = std::move(inverted);
  source.exrUnit = std::move(exrUnit);
  source.flight = std::move(flight);
  std::vector<Observation> observations;
  for (Observation observation : capture.observations) {
    const int photo = newIndex[observation.photo];
    if (photo < 0) continue;
    observation.photo = static_cast<uint32_t>(photo);
    observations.push_back(observation);
  }
  std::stable_sort(observations.begin(), observations.end(),
                   [](const Observation& a, const Observation& b) { return a.photo < b.photo; });
  capture.observations = std::move(observations);
}

std::vector<PhotoFacts> cleanSource(SourceCapture& source, ThreadPool& pool) {
  Capture& capture = source.capture;
  std::vector<PhotoFacts> facts(capture.photos.size());
  pool.run(facts.size(), [&](size_t i, int) { facts[i] = readPhotoFacts(capture.photos[i]); });

  std::vector<std::string> missing, unreadable, repeated, misshapen;
  std::set<fs::path> seen;
  std::vector<size_t> order;
  size_t rescaled = 0;
  std::vector<std::pair<float, float>> factors(facts.size(), {1.0f, 1.0f});
  for (size_t i = 0; i < facts.size(); ++i) {
    Photo& photo = capture.photos[i];
    std::error_code status;
    if (!fs::is_regular_file(photo.image, status)) {
      missing.push_back(photo.name);
    } else if (facts[i].width <= 0 || photo.camera >= static_cast<int>(capture.cameras.size())) {
      unreadable.push_back(photo.name);
    } else if (!seen.insert(photo.image).second) {
      repeated.push_back(photo.name);
    } else {
      const Camera camera = capture.cameras[static_cast<size_t>(photo.camera)];
      if (camera.width != facts[i].width || camera.height != facts[i].height) {
        if (!sameShape(camera, facts[i].width, facts[i].height)) {
          misshapen.push_back(fmt::format("{} is {}x{}, its camera {}x{}", photo.name, facts[i].width, facts[i].height,
                                          camera.width, camera.height));
          continue;
        }
        ++rescaled;
        const Camera scaled = camera.scaledTo(facts[i].width, facts[i].height);
        factors[i] = {static_cast<float>(facts[i].width) / static_cast<float>(camera.width),
                      static_cast<float>(facts[i].height) / static_cast<float>(camera.height)};
        const auto match = std::find(capture.cameras.begin(), capture.cameras.end(), scaled);
        photo.camera = static_cast<int>(match - capture.cameras.begin());
        if (match == capture.cameras.end()) capture.cameras.push_back(scaled);
      }
      if (!photo.gps) photo.gps = facts[i].tags.gps;
      order.push_back(i);
    }
  }
  for (Observation& observation : capture.observations) {
    const auto [x, y] = factors[observation.photo];
    observation.x *= x;
    observation.y *= y;
    observation.error *= (x + y) / 2;
  }
  warnDropped(missing, "named by the source are not on disk");
  warnDropped(unreadable, "cannot be read as JPEG or PNG");
  warnDropped(repeated, "are named more than once");
  warnDropped(misshapen, "have another shape than their camera");
  if (rescaled > 0) warn("{} photos have another size than their camera; lenses scaled to fit", rescaled);

  std::stable_sort(order.begin(), order.end(),
                   [&](size_t a, size_t b) { return naturalLess(capture.photos[a].name, capture.photos[b].name); });
  std::vector<PhotoFacts> remaining;
  for (const size_t i : order) remaining.push_back(facts[i]);
  keepPhotos(source, order);
  return remaining;
}

}  // namespace tessera

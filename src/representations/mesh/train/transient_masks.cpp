#include "representations/mesh/train/transient_masks.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "base/image_io.h"
#include "base/log.h"
#include "base/order_statistics.h"
#include "representations/mesh/train/coarse_view.h"
#include "train/photo_visibility.h"

namespace tessera {
namespace {

using nlohmann::json;

constexpr double kPixelsOfPhoto = 1 << 15, kPixelsOfAll = 1 << 24;  // that are compared, at most
constexpr double kLeastStride = 2;                                  // pixels
constexpr double kVoxelPixels = 2;                                  // edge of a voxel in pixels that are compared

// Returns the distance between the pixels of a photo that are compared.
double findStride(const Camera& camera, size_t photos) {
  const double pixels = static_cast<double>(camera.width) * camera.height;
  const double most = std::min(kPixelsOfPhoto, kPixelsOfAll / static_cast<double>(photos));
  return std::max(kLeastStride, std::sqrt(pixels / most));
}

// Returns a photo over black, as fields are rendered.
ImageF readPhotoOverBlack(const Photo& photo, const Camera& small) {
  const ImageF image = downscaleByArea(toFloat(readImage(photo.image).image), small.width, small.height);
  ImageF colours(small.width, small.height, 3);
  for (size_t pixel = 0; pixel < colours.pixelCount(); ++pixel) {
    const float* from = &image.pixels[static_cast<size_t>(image.channels) * pixel];
    for (size_t k = 0; k < 3; ++k)
      colours.pixels[3 * pixel + k] = from[image.channels >= 3 ? k : 0] * (image.channels == 4 ? from[3] : 1.0f);
  }
  return colours;
}

// Compares one photo, and appends the widths of its pixels on the surfaces.
ComparedPhoto comparePhoto(const Photo& photo, const Camera& camera, double stride, FieldRenderer& renderer,
                           const SceneFrame& frame, std::vector<float>& pixelWidths) {
  const CoarseView view(renderer, strideCamera(camera, stride), photo.worldFromCamera);
  const Camera& small = view.camera();
  ImageU8 mask = readPhotoMask(photo, camera);
  if (!mask.empty()) mask = downscaleByArea(mask, small.width, small.height);
  ComparedPhoto compared;
  compared.points = ImageF(small.width, small.height, 3, std::numeric_limits<float>::quiet_NaN());
  for (int y = 0; y < small.height; ++y) {
    for (int x = 0; x < small.width; ++x) {
      const auto surface = view.surfaceAt(x, y, kSolidOpacity);
      if (!surface || (!mask.empty() && *mask.at(x, y) < 255)) continue;
      const Vec3d at = frame.sceneFromWorld(surface->at);
      for (int axis = 0; axis < 3; ++axis) compared.points.at(x, y)[axis] = static_cast<float>(at[axis]);
      pixelWidths.push_back(static_cast<float>(surface->depth / small.focalX() * frame.scale));
    }
  }
  compared.difference = subtractField(readPhotoOverBlack(photo, small), view.image().colour, compared.points);
  return compared;
}

struct CombinedMask {
  ImageU8 mask;
  size_t shown = 0,
         excluded = 0;  // pixels that the photo's own mask does not exclude, and those of them that are 0 here
};

// Returns the photo's own mask with 0 where the photo shows something transient, too.
CombinedMask combineMasks(const Photo& photo, const Camera& camera, const ImageU8& transient) {
  constexpr uint8_t kShown = 128;  // as in ray_batch.cpp
  CombinedMask combined{readPhotoMask(photo, camera)};
  ImageU8& mask = combined.mask;
  if (mask.empty()) mask = ImageU8(camera.width, camera.height, 1, 255);
  for (int y = 0; y < mask.height; ++y) {
    for (int x = 0; x < mask.width; ++x) {
      if (*mask.at(x, y) < kShown) continue;
      ++combined.shown;
      const int across = static_cast<int>(int64_t{x} * transient.width / mask.width);
      const int down = static_cast<int>(int64_t{y} * transient.height / mask.height);
      if (*transient.at(across, down) != 0) continue;
      *mask.at(x, y) = 0;
      ++combined.excluded;
    }
  }
  return combined;
}

}  // namespace

ListedFolder transientFolder(const fs::path& mesh) {
  return ListedFolder(mesh / "transient", "masks");
}

ComparedPhotos comparePhotos(const Capture& capture, FieldModel& coarse, const OnPhoto& onPhoto) {
  ComparedPhotos compared;
  FieldRenderer renderer(coarse);
  std::vector<float> pixelWidths;
  const std::vector<int> photos = capture.photosIn(Split::train);
  for (const int number : photos) {
    const Photo& photo = capture.photos[number];
    const Camera& camera = capture.cameras[photo.camera];
    compared.photos.push_back(
        comparePhoto(photo, camera, findStride(camera, photos.size()), renderer, coarse.frame(), pixelWidths));
    onPhoto(static_cast<int64_t>(compared.photos.size()), static_cast<int64_t>(photos.size()));
  }
  if (!pixelWidths.empty()) compared.pixelWidth = upperMedian(pixelWidths);
  return compared;
}

TransientSettings chooseTransientSettings(const ComparedPhotos& compared) {
  TransientSettings settings;
  if (compared.pixelWidth > 0) settings.voxel = kVoxelPixels * compared.pixelWidth;
  return settings;
}

void writeTransientMasks(const Capture& capture, const std::vector<ImageU8>& transients, const fs::path& mesh) {
  const std::vector<int> photos = capture.photosIn(Split::train);
  const ListedFolder folder = transientFolder(mesh);
  json files = json::object();
  size_t shown = 0, excluded = 0;
  for (size_t i = 0; i < photos.size(); ++i) {
    const Photo& photo = capture.photos[photos[i]];
    const CombinedMask combined = combineMasks(photo, capture.cameras[photo.camera], transients[i]);
    shown += combined.shown;
    excluded += combined.excluded;
    if (combined.excluded == 0) continue;
    const std::string file = fmt::format("{}.png", photos[i]);
    folder.writeFile(file, encodePng(combined.mask));
    files[photo.name] = file;
  }
  folder.writeList(files);
  inform("transient: {:.2f} % of the photos' pixels, in {} of {} photos, show what moves, and are left out",
         100.0 * static_cast<double>(excluded) / static_cast<double>(std::max<size_t>(1, shown)), files.size(),
         photos.size());
}

void makeTransientMasks(const Capture& capture, FieldModel& coarse, const fs::path& mesh, const OnPhoto& onPhoto) {
  ComparedPhotos compared = comparePhotos(capture, coarse, onPhoto);
  const TransientSettings settings = chooseTransientSettings(compared);
  writeTransientMasks(capture, findTransientPixels(std::move(compared.photos), settings), mesh);
}

Capture applyTransientMasks(Capture capture, const fs::path& mesh) {
  const ListedFolder folder = transientFolder(mesh);
  if (!folder.isComplete()) return capture;
  const json masks = folder.readList();
  const auto require = [&](bool isValid, const std::string& what) {
    if (!isValid) throw folder.malformed(what);
  };
  require(masks.is_object(), "is not an object");
  for (Photo& photo : capture.photos) {
    if (!masks.contains(photo.name)) continue;
    const json& file = masks[photo.name];
    require(file.is_string(), "does not name the mask of '" + photo.name + "'");
    const auto mask = resolveInside(folder.path(), file.get<std::string>());
    require(mask && fs::exists(*mask), "names a mask of '" + photo.name + "' that is not there");
    photo.mask = *mask;
  }
  return capture;
}

}  // namespace tessera

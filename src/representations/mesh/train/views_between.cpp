#include "representations/mesh/train/views_between.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <unordered_map>

#include "base/error.h"
#include "base/image_io.h"
#include "base/log.h"
#include "base/random.h"
#include "representations/field/train/field_renderer.h"
#include "representations/mesh/train/mesh_start.h"

namespace tessera {
namespace {

constexpr double kHalf = 0.5;                // of a photo's width and height
constexpr double kMaxPixels = 1 << 18;       // of a view
constexpr size_t kNeighbours = 4;            // of a photo, the nearest
constexpr double kSimilarDirection = 0.7;    // cosine between optical axes
constexpr double kBeyond = 0.5, kAside = 1;  // range of places, in distances between the photo and its neighbour
constexpr uint64_t kStream = 0x76696577;

fs::path viewsFolder(const fs::path& mesh) {
  return mesh / "views";
}
fs::path listOfViews(const fs::path& mesh) {
  return viewsFolder(mesh) / "views.json";
}
std::string viewName(size_t view) {
  return fmt::format("views/{:04}.png", view);
}

Camera smallerCamera(const Camera& camera) {
  const double factor = std::min(kHalf, std::sqrt(kMaxPixels / camera.width / camera.height));
  const auto scaled = [&](int length) { return std::max(1, static_cast<int>(std::lround(length * factor))); };
  return camera.scaledTo(scaled(camera.width), scaled(camera.height));
}

// Returns the training photos nearest to one, of those that look in a similar direction.
std::vector<int> findNeighbours(const Capture& capture, const std::vector<int>& photos, int of) {
  const Pose& pose = capture.photos[of].worldFromCamera;
  std::vector<std::pair<double, int>> near;
  for (const int photo : photos) {
    const Pose& other = capture.photos[photo].worldFromCamera;
    const double distance = (other.translation - pose.translation).norm();
    if (photo == of || distance <= 0 || other.rotation.col(2).dot(pose.rotation.col(2)) < kSimilarDirection) continue;
    near.emplace_back(distance, photo);
  }
  std::sort(near.begin(), near.end());
  std::vector<int> neighbours;
  for (size_t i = 0; i < std::min(kNeighbours, near.size()); ++i) neighbours.push_back(near[i].second);
  return neighbours;
}

Pose placeBetween(const Pose& a, const Pose& b, const RandomStream& random) {
  const auto within = [&](uint64_t index, double low, double high) {
    return low + (high - low) * random.uniformDouble(index);
  };
  const double along = within(0, -kBeyond, 1 + kBeyond), distance = (b.translation - a.translation).norm();
  const Eigen::Quaterniond from(a.rotation), to(b.rotation);
  Pose pose;
  pose.rotation = from.slerp(std::clamp(along, 0.0, 1.0), to).normalized().toRotationMatrix();
  pose.translation = a.translation + along * (b.translation - a.translation);
  for (int axis = 0; axis < 2; ++axis) {
    const double aside = within(1 + static_cast<uint64_t>(axis), -kAside, kAside) / 2;
    pose.translation += aside * distance * pose.rotation.col(axis);
  }
  return pose;
}

}  // namespace

double countPhotosOfPlace(const Capture& capture, FieldModel& coarse) {
  constexpr float kSurface = 0.5f;  // opacity
  constexpr double kTilesAcrossPlace = 2;
  FieldRenderer renderer(coarse);
  struct Sight {
    int photo;
    Vec3d at;  // in the scene of the coarse field
  };
  std::vector<Sight> sights;
  std::vector<double> widths;  // of tiles
  for (const int number : capture.photosIn(Split::train)) {
    const Photo& photo = capture.photos[number];
    const Camera& camera = capture.cameras[photo.camera];
    const Camera small = camera.scaledTo(std::max(1, camera.width / kTileEdge), std::max(1, camera.height / kTileEdge));
    const RenderedView view = renderer.render(small, photo.worldFromCamera, nullptr);
    for (int y = 0; y < small.height; ++y) {
      for (int x = 0; x < small.width; ++x) {
        const auto inCamera = small.directionInCamera({x + 0.5, y + 0.5});
        const float opacity = *view.opacity.at(x, y);
        if (!inCamera || inCamera->z() <= 0 || opacity < kSurface) continue;
        const double depth = *view.depth.at(x, y) / opacity;
        const Vec3d at = photo.worldFromCamera * (*inCamera / inCamera->z() * depth);
        sights.push_back({number, coarse.frame().sceneFromWorld(at)});
        widths.push_back(depth / small.focalX() * coarse.frame().scale);
      }
    }
  }
  if (sights.empty()) return 0;
  const auto middle = widths.begin() + static_cast<ptrdiff_t>(widths.size() / 2);
  std::nth_element(widths.begin(), middle, widths.end());
  const double place = kTilesAcrossPlace * *middle;
  const auto key = [&](const Vec3d& at) {
    uint64_t hash = 0;
    for (int axis = 0; axis < 3; ++axis) hash = mix64(hash ^ static_cast<uint64_t>(std::llround(at[axis] / place)));
    return hash;
  };
  std::unordered_map<uint64_t, std::set<int>> photosOfPlace;
  for (const Sight& sight : sights) photosOfPlace[key(sight.at)].insert(sight.photo);
  std::vector<size_t> counts;
  for (const Sight& sight : sights) counts.push_back(photosOfPlace.at(key(sight.at)).size());
  const auto median = counts.begin() + static_cast<ptrdiff_t>(counts.size() / 2);
  std::nth_element(counts.begin(), median, counts.end());
  return static_cast<double>(*median);
}

size_t countMissingViews(size_t photos, double photosOfPlace, int enough) {
  if (photosOfPlace <= 0 || photosOfPlace >= enough) return 0;
  const double missing = static_cast<double>(photos) * (enough / photosOfPlace - 1);
  return std::min(static_cast<size_t>(std::ceil(missing)), kMaxViewsPerPhoto * photos);
}

Capture placeViewsBetween(Capture capture, size_t count, uint64_t seed) {
  const std::vector<int> photos = capture.photosIn(Split::train);
  std::map<int, int> smallerCameras;  // by the photo's camera
  std::map<int, std::vector<int>> neighboursOfPhoto;
  for (size_t view = 0; view < count; ++view) {
    const RandomStream random(mix64(seed ^ kStream), view);
    const int number = photos[view % photos.size()];
    auto [neighbours, isNew] = neighboursOfPhoto.try_emplace(number);
    if (isNew) neighbours->second = findNeighbours(capture, photos, number);
    Photo added;
    added.name = viewName(view);
    added.worldFromCamera = capture.photos[number].worldFromCamera;
    if (!neighbours->second.empty()) {
      const int other = neighbours->second[random.below(3, static_cast<uint32_t>(neighbours->second.size()))];
      added.worldFromCamera = placeBetween(added.worldFromCamera, capture.photos[other].worldFromCamera, random);
    }
    const int camera = capture.photos[number].camera;
    const auto [smaller, isFirst] = smallerCameras.try_emplace(camera, static_cast<int>(capture.cameras.size()));
    if (isFirst) capture.cameras.push_back(smallerCamera(Camera(capture.cameras[camera])));
    added.camera = smaller->second;
    capture.photos.push_back(std::move(added));
  }
  return capture;
}

void makeViewsBetween(const Capture& capture, FieldModel& coarse, const fs::path& mesh, int enough, uint64_t seed) {
  const double photosOfPlace = countPhotosOfPlace(capture, coarse);
  const size_t photos = capture.photosIn(Split::train).size();
  const size_t count = countMissingViews(photos, photosOfPlace, enough);
  const Capture placed = placeViewsBetween(capture, count, seed);
  FieldRenderer renderer(coarse);
  for (size_t view = 0; view < count; ++view) {
    const Photo& photo = placed.photos[capture.photos.size() + view];
    const RenderedView image = renderer.render(placed.cameras[photo.camera], photo.worldFromCamera, nullptr);
    writeFileAtomically(mesh / photo.name, encodePng(toBytes(image.colour)), true);
  }
  writeFileAtomically(listOfViews(mesh), nlohmann::json({{"views", count}}).dump(2) + "\n", true);
  inform("{:.0f} photos show the same place in the median; {}", photosOfPlace,
         count > 0 ? fmt::format("{} views between them are added", count) : "no views between them are needed");
}

bool haveViewsBetween(const fs::path& mesh) {
  return fs::exists(listOfViews(mesh));
}

void removeViewsBetween(const fs::path& mesh) {
  if (!haveViewsBetween(mesh)) return;
  fs::remove(listOfViews(mesh));  // first, so that no list of missing views remains
  fs::remove_all(viewsFolder(mesh));
}

Capture addViewsBetween(Capture capture, const fs::path& mesh, uint64_t seed) {
  if (!haveViewsBetween(mesh)) return capture;
  const fs::path path = listOfViews(mesh);
  const nlohmann::json list = nlohmann::json::parse(readTextFile(path), nullptr, false);
  const size_t photos = capture.photos.size(), most = kMaxViewsPerPhoto * capture.photosIn(Split::train).size();
  constexpr const char* kRemedy = "remove the file, and resume the training";
  if (!list.is_object() || !list.contains("views") || !list["views"].is_number_unsigned() ||
      list["views"].get<uint64_t>() > most) {
    throw Error(path.string(), "views", fmt::format("is not a number up to {}", most), kRemedy);
  }
  capture = placeViewsBetween(std::move(capture), list["views"].get<size_t>(), seed);
  for (size_t view = photos; view < capture.photos.size(); ++view) {
    Photo& photo = capture.photos[view];
    photo.image = mesh / photo.name;
    if (!fs::exists(photo.image)) throw Error(path.string(), "views", "'" + photo.name + "' is missing", kRemedy);
  }
  return capture;
}

}  // namespace tessera

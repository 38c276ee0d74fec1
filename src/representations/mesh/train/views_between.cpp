#include "representations/mesh/train/views_between.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <unordered_map>

#include "base/image_io.h"
#include "base/log.h"
#include "base/order_statistics.h"
#include "base/random.h"
#include "representations/mesh/train/coarse_view.h"
#include "representations/mesh/train/mesh_start.h"

namespace tessera {
namespace {

constexpr double kHalf = 0.5;                // of a photo's width and height
constexpr double kMaxPixels = 1 << 18;       // of a view
constexpr size_t kNeighbours = 4;            // of a photo, the nearest
constexpr double kSimilarDirection = 0.7;    // cosine between optical axes
constexpr double kBeyond = 0.5, kAside = 1;  // range of places, in distances between the photo and its neighbour
constexpr uint64_t kStream = 0x76696577;

std::string viewFile(size_t view) {
  return fmt::format("{:04}.png", view);
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

ListedFolder viewsFolder(const fs::path& mesh) {
  return ListedFolder(mesh / "views", "views");
}

double countPhotosOfPlace(const Capture& capture, FieldModel& coarse, const OnPhoto& onPhoto) {
  constexpr float kSurface = 0.5f;  // opacity
  constexpr double kTilesAcrossPlace = 2;
  FieldRenderer renderer(coarse);
  struct Sight {
    int photo;
    Vec3d at;  // in the scene of the coarse field
  };
  std::vector<Sight> sights;
  std::vector<double> widths;  // of tiles
  const int edge = tileEdge(capture);
  const std::vector<int> photos = capture.photosIn(Split::train);
  int64_t done = 0;
  for (const int number : photos) {
    const Photo& photo = capture.photos[number];
    const Camera& camera = capture.cameras[photo.camera];
    const CoarseView view(renderer, strideCamera(camera, edge), photo.worldFromCamera);
    for (int y = 0; y < view.camera().height; ++y) {
      for (int x = 0; x < view.camera().width; ++x) {
        const auto surface = view.surfaceAt(x, y, kSurface);
        if (!surface) continue;
        sights.push_back({number, coarse.frame().sceneFromWorld(surface->at)});
        widths.push_back(std::abs(surface->depth) / view.camera().focalX() * coarse.frame().scale);
      }
    }
    onPhoto(++done, static_cast<int64_t>(photos.size()));
  }
  if (sights.empty()) return 0;
  const double place = kTilesAcrossPlace * upperMedian(widths);
  const auto key = [&](const Vec3d& at) {
    uint64_t hash = 0;
    for (int axis = 0; axis < 3; ++axis) hash = mix64(hash ^ static_cast<uint64_t>(std::llround(at[axis] / place)));
    return hash;
  };
  std::unordered_map<uint64_t, std::set<int>> photosOfPlace;
  for (const Sight& sight : sights) photosOfPlace[key(sight.at)].insert(sight.photo);
  std::vector<size_t> counts;
  for (const Sight& sight : sights) counts.push_back(photosOfPlace.at(key(sight.at)).size());
  return static_cast<double>(upperMedian(counts));
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
    added.name = "views/" + viewFile(view);
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

void makeViewsBetween(const Capture& capture, FieldModel& coarse, const fs::path& mesh, int enough, uint64_t seed,
                      const OnPhoto& onPhoto) {
  const double photosOfPlace = countPhotosOfPlace(capture, coarse, onPhoto);
  const size_t photos = capture.photosIn(Split::train).size();
  const size_t count = countMissingViews(photos, photosOfPlace, enough);
  const Capture placed = placeViewsBetween(capture, count, seed);
  const ListedFolder folder = viewsFolder(mesh);
  FieldRenderer renderer(coarse);
  for (size_t view = 0; view < count; ++view) {
    const Photo& photo = placed.photos[capture.photos.size() + view];
    const RenderedView image = renderer.render(placed.cameras[photo.camera], photo.worldFromCamera, nullptr);
    folder.writeFile(viewFile(view), encodePng(toBytes(image.colour)));
    onPhoto(static_cast<int64_t>(photos + view + 1), static_cast<int64_t>(photos + count));
  }
  folder.writeList(count);
  inform("{:.0f} photos show the same place in the median; {}", photosOfPlace,
         count > 0 ? fmt::format("{} views between them are added", count) : "no views between them are needed");
}

Capture addViewsBetween(Capture capture, const fs::path& mesh, uint64_t seed) {
  const ListedFolder folder = viewsFolder(mesh);
  if (!folder.isComplete()) return capture;
  const nlohmann::json count = folder.readList();
  const size_t photos = capture.photos.size(), most = kMaxViewsPerPhoto * capture.photosIn(Split::train).size();
  if (!count.is_number_unsigned()) throw folder.malformed("is not a number");
  if (count.get<uint64_t>() > most) {
    throw Error(capture.root.string(), "transforms.json",
                fmt::format("has too few training photos for the {} views between photos that {} lists",
                            count.get<uint64_t>(), folder.file("views.json").string()),
                "use the capture that the model was trained on");
  }
  capture = placeViewsBetween(std::move(capture), count.get<size_t>(), seed);
  for (size_t view = photos; view < capture.photos.size(); ++view) {
    Photo& photo = capture.photos[view];
    photo.image = folder.file(viewFile(view - photos));
    if (!fs::exists(photo.image)) throw folder.malformed("'" + photo.image.filename().string() + "' is missing");
  }
  return capture;
}

}  // namespace tessera

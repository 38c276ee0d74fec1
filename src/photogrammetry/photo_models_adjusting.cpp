// The final bundle adjustment of PhotoModels.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <unordered_map>

#include "base/error.h"
#include "base/log.h"
#include "import/colmap_model.h"
#include "photogrammetry/colmap_writer.h"
#include "photogrammetry/outlying_observations.h"
#include "photogrammetry/photo_models.h"

namespace tessera {
namespace {

constexpr size_t kPhotosForFullLens = 40;  // of a camera, from which on its principal point is adjusted
constexpr double kFarthestCentre = 0.05;   // of the size of the picture, of a principal point from the middle
constexpr int kRefits = 2;                 // without outlying observations

Camera withDecentring(Camera camera) {
  if (camera.lens != LensModel::radial) return camera;
  const auto [f, cx, cy, k1, k2] = std::tuple(camera.parameters[0], camera.parameters[1], camera.parameters[2],
                                              camera.parameters[3], camera.parameters[4]);
  camera.lens = LensModel::openCv;
  camera.parameters = {f, f, cx, cy, k1, k2, 0, 0};
  return camera;
}

// Whether no photo of a model has been lost, and all its lenses are likely but for those of a few photos, which may be
// any. `photosByCamera` and `before`: how many photos each camera had, and their lenses.
bool isPlausible(const fs::path& folder, const std::map<uint32_t, size_t>& photosByCamera,
                 const std::unordered_map<uint32_t, Camera>& before) {
  if (photosIn(folder).empty()) return false;
  const ColmapModel model = readColmapModel(folder);
  size_t photos = 0;
  for (const auto& [camera, count] : photosByCamera) photos += count;
  if (model.images.size() != photos) return false;
  constexpr size_t kFew = 20;  // one in so many
  std::set<uint32_t> unlikely;
  for (const auto& [id, camera] : model.cameras) {
    const auto was = before.find(id);
    if (was == before.end()) return false;
    const double dx = (camera.centreX() - 0.5 * camera.width) / camera.width,
                 dy = (camera.centreY() - 0.5 * camera.height) / camera.height;
    const double oblong = camera.focalX() / camera.focalY();
    const double longer = camera.focalX() / was->second.focalX();
    if (!(std::abs(dx) < kFarthestCentre && std::abs(dy) < kFarthestCentre && oblong > 0.98 && oblong < 1.02 &&
          longer > 0.8 && longer < 1.25))
      unlikely.insert(id);
  }
  size_t concerned = 0;
  for (const auto& [camera, count] : photosByCamera) concerned += unlikely.contains(camera) ? count : 0;
  return kFew * concerned <= photos;
}

}  // namespace

void PhotoModels::discardAdjusted() const {
  discardBegunAdjustments();
  removeFolder(folder_ / "adjusted");
}

void PhotoModels::discardBegunAdjustments() const {
  // The last name is one of former versions.
  for (const char* name : {"adjusted.begun", "adjusted.partial", "adjusted.refused", "adjusted.result"})
    removeFolder(folder_ / name);
  for (int refits = 0; refits <= kRefits; ++refits) removeFolder(adjustedOnce(refits));
}

fs::path PhotoModels::adjustedOnce(int refits) const {
  return folder_ / fmt::format("adjusted.{}", refits);
}

void PhotoModels::adjust(const Watch& watch) {
  if (fs::exists(folder_ / "adjusted")) return discardBegunAdjustments();
  const fs::path input = last(false), begun = folder_ / "adjusted.begun", partial = folder_ / "adjusted.partial";
  // Whole models are held no longer than needed: COLMAP takes much memory meanwhile.
  std::unordered_map<uint32_t, Camera> camerasBefore;
  std::map<uint32_t, size_t> photosByCamera;
  {
    const ColmapModel before = readColmapModel(input);
    camerasBefore = before.cameras;
    for (const ColmapModel::Image& image : before.images) ++photosByCamera[image.camera];
  }
  const bool allHaveMany = std::all_of(photosByCamera.begin(), photosByCamera.end(),
                                       [](const auto& entry) { return entry.second >= kPhotosForFullLens; });
  // Returns whether a plausible model results from the one in `begun`; then it is in adjustedOnce(refits).
  const auto adjustBegun = [&](bool fullLens, int refits) {
    removeFolder(partial);
    makeFolder(partial);
    try {
      adjustBundle("adjusting", begun, partial, fullLens && allHaveMany,
                   [&] { watch(static_cast<int64_t>(list_.photos.size())); });
    } catch (const ColmapKilled&) {
      throw;
    } catch (const Error& error) {
      warn("a bundle adjustment is left out: {}", error.what());
      return false;
    }
    requireWhole(partial);
    if (!isPlausible(partial, photosByCamera, camerasBefore)) return false;
    replaceFolder(partial, adjustedOnce(refits));
    return true;
  };
  const auto adjustFirst = [&](bool fullLens) {
    ColmapModel model = readColmapModel(input);
    for (auto& [id, camera] : model.cameras)
      if (fullLens && photosByCamera[id] >= kPhotosForFullLens) camera = withDecentring(camera);
    removeFolder(begun);
    writeColmapModel(model, begun);
    return adjustBegun(fullLens, 0);
  };
  // Returns false also if there are no outlying observations.
  const auto adjustAgain = [&](bool fullLens, int refits) {
    ColmapModel model = readColmapModel(adjustedOnce(refits - 1));
    if (removeOutlyingObservations(model) == 0) return false;
    removeFolder(begun);
    writeColmapModel(model, begun);
    return adjustBegun(fullLens, refits);
  };
  const fs::path refused = folder_ / "adjusted.refused";  // there if a full lens was
  bool fullLens = !fs::exists(refused);
  int refits = kRefits;  // of the last adjustment
  while (refits >= 0 && photosIn(adjustedOnce(refits)).empty()) --refits;
  if (refits < 0 && fullLens) {
    fullLens = adjustFirst(true);
    if (fullLens) refits = 0;
    if (!fullLens) makeFolder(refused);
  }
  if (refits < 0 && adjustFirst(false)) refits = 0;
  if (refits >= 0) {
    for (; refits < kRefits && adjustAgain(fullLens, refits + 1); ++refits) removeFolder(adjustedOnce(refits));
    replaceFolder(adjustedOnce(refits), folder_ / "adjusted");
  } else {
    warn("the final bundle adjustment gives no plausible lens; poses stay as they were estimated");
    removeFolder(partial);
    fs::copy(input, partial);
    replaceFolder(partial, folder_ / "adjusted");
  }
  discardBegunAdjustments();
}

}  // namespace tessera

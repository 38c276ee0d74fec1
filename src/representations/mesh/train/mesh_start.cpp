#include "representations/mesh/train/mesh_start.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/order_statistics.h"
#include "representations/mesh/train/coarse_view.h"
#include "scene/contraction.h"

namespace tessera {
namespace {

constexpr int kPhotoStride = 3;  // pixels, of the rays that find surfaces, at least

double countTrainingPixels(const Capture& capture) {
  double pixels = 0;
  for (const int photo : capture.photosIn(Split::train)) {
    const Camera& camera = capture.cameras[capture.photos[photo].camera];
    pixels += static_cast<double>(camera.width) * camera.height;
  }
  return pixels;
}

// Returns the stride at which the training photos have at most `most` pixels, at least `least`.
double strideFor(const Capture& capture, double most, double least) {
  return std::max(least, std::sqrt(countTrainingPixels(capture) / most));
}
constexpr double kNever = std::numeric_limits<double>::infinity();

// Returns the distances at which a ray is in a box around the origin; an empty interval if it misses it.
std::array<double, 2> rangeInBox(const Vec3d& origin, const Vec3d& direction, const std::array<float, 3>& halfEdges) {
  std::array<double, 2> range = {0, kNever};
  for (int axis = 0; axis < 3; ++axis) {
    const double half = halfEdges[axis];
    if (direction[axis] == 0) {
      if (std::abs(origin[axis]) > half) return {kNever, 0};
      continue;
    }
    const double side = std::copysign(half, direction[axis]);
    range[0] = std::max(range[0], (-side - origin[axis]) / direction[axis]);
    range[1] = std::min(range[1], (side - origin[axis]) / direction[axis]);
  }
  return range;
}

void addTile(TileShares& shares, const PhotoTile& tile) {
  const double pixels = static_cast<double>(tile.right - tile.left) * static_cast<double>(tile.bottom - tile.top);
  shares.until.push_back(shares.total() + pixels);
  shares.tiles.push_back(tile);
}

// Whether a ray crosses a block, and whatever it shows lies beyond the block's grid. `clear`: the distance up to which
// it shows nothing.
bool showsBehind(const MeshPart& block, const Vec3d& eye, const Vec3d& towards, double clear) {
  constexpr double kDepthError = 0.02;  // of the coarse field's distances
  constexpr float kGrid = static_cast<float>(1 / (1 - 2 * kBlockMargin));
  const auto [enter, leave] = rangeInBox(eye, towards, block.halfEdges);
  if (enter >= leave) return false;
  // Nothing is seen below a block: where the coarse field shows something there, it has a hole in the ground.
  constexpr double kBottom = 1e-3;
  if (eye.z() + leave * towards.z() < kBottom - block.halfEdges[2]) return false;
  return (1 - kDepthError) * clear > rangeInBox(eye, towards, {kGrid, kGrid, kGrid})[1];
}

}  // namespace

int tileEdge(const Capture& capture) {
  return static_cast<int>(std::ceil(strideFor(capture, kMaxTiles, kLeastTileEdge)));
}

bool MeshStart::isEmpty() const {
  return pixels() == 0 || std::find(cells.begin(), cells.end(), true) == cells.end();
}

double MeshStart::pixels() const {
  double sum = 0;
  for (const TileShares& photo : tiles) sum += photo.total();
  return sum;
}

SurfaceSurvey::SurfaceSurvey(const Capture& capture, FieldModel& coarse, bool seesPoints, const OnPhoto& onPhoto)
    : frame_(coarse.frame()), space_(coarse.space()), photoCount_(capture.photos.size()) {
  FieldRenderer renderer(coarse);
  constexpr double kMaxPoints = 1 << 22;
  const int edge = tileEdge(capture);
  const double strideOfPoints = strideFor(capture, kMaxPoints, kPhotoStride);
  const std::vector<int> photos = capture.photosIn(Split::train);
  const int64_t all = 2 * static_cast<int64_t>(photos.size());  // cullUnseen looks at them again
  int64_t done = 0;
  for (const int photo : photos) {
    const Photo& of = capture.photos[photo];
    addSights(photo, capture.cameras[of.camera], of.worldFromCamera, edge, renderer);
    if (seesPoints) addSurface(of, capture.cameras[of.camera], strideOfPoints, renderer);
    onPhoto(++done, all);
  }
  CullOptions options;
  constexpr double kMaxRays = 1 << 24;
  options.stride = static_cast<int>(std::ceil(strideFor(capture, kMaxRays, kPhotoStride)));
  renderer.cullUnseen(capture, options, [&](int64_t culled, int64_t) { onPhoto(done + culled, all); });
  cells_ = coarse.device().read(renderer.cells());
}

void SurfaceSurvey::addSights(int photo, const Camera& camera, const Pose& pose, int edge, FieldRenderer& renderer) {
  constexpr float kSurface = 0.5f, kClear = 0.1f;  // opacities, at least and at most
  const CoarseView view(renderer, strideCamera(camera, edge), pose);
  const int columns = view.camera().width, rows = view.camera().height;
  const auto distanceAt = [&](int x, int y, float opacity) {
    if (!view.knowsDepth(x, y)) return 0.0;
    const auto surface = view.surfaceAt(x, y, opacity);
    return surface ? (surface->at - pose.translation).norm() : kNever;
  };
  for (int y = 0; y < rows; ++y) {
    for (int x = 0; x < columns; ++x) {
      const auto inCamera = view.camera().directionInCamera({x + 0.5, y + 0.5});
      if (!inCamera || !view.knowsDepth(x, y)) continue;
      Sight sight;
      sight.tile = {photo, static_cast<uint32_t>(camera.width * x / columns),
                    static_cast<uint32_t>(camera.height * y / rows),
                    static_cast<uint32_t>(camera.width * (x + 1) / columns),
                    static_cast<uint32_t>(camera.height * (y + 1) / rows)};
      sight.eye = pose.translation;
      sight.towards = (pose.rotation * *inCamera).normalized();
      sight.distance = distanceAt(x, y, kSurface);
      sight.isSurface = sight.distance < kNever;
      sight.pixelWidth = sight.distance / camera.focalX();
      sight.clear = kNever;
      for (int besideY = std::max(0, y - 1); besideY <= std::min(rows - 1, y + 1); ++besideY)
        for (int besideX = std::max(0, x - 1); besideX <= std::min(columns - 1, x + 1); ++besideX)
          sight.clear = std::min(sight.clear, distanceAt(besideX, besideY, kClear));
      sights_.push_back(sight);
    }
  }
}

void SurfaceSurvey::addSurface(const Photo& photo, const Camera& camera, double stride, FieldRenderer& renderer) {
  const CoarseView view(renderer, strideCamera(camera, stride), photo.worldFromCamera);
  for (int y = 0; y < view.camera().height; ++y) {
    for (int x = 0; x < view.camera().width; ++x) {
      if (const auto surface = view.surfaceAt(x, y, kSolidOpacity))
        surface_.push_back(frame_.sceneFromWorld(surface->at).cast<float>());
    }
  }
}

std::vector<float> SurfaceSurvey::findDisplacements(const MeshPart& part, const OctahedraDomain& domain) const {
  constexpr uint32_t kLeastPoints = 3;
  constexpr float kReach = 0.9f * kMaxDisplacement;
  const OctahedraGrid& grid = domain.grids[0];
  std::vector<Vec3d> sums(grid.cells(), Vec3d::Zero());
  std::vector<uint32_t> counts(grid.cells());
  for (const Vec3f& point : surface_) {
    const Vec3d at = part.frame.sceneFromWorld(frame_.worldFromScene(point.cast<double>()));
    const auto cell = domain.latticeCell(at);
    if (!cell) continue;
    for (int axis = 0; axis < 3; ++axis) {
      const float* const m = grid.gridFromScene.data() + size_t{4} * axis;
      const double inGrid = m[0] * at.x() + m[1] * at.y() + m[2] * at.z() + m[3];
      sums[*cell][axis] += inGrid - std::floor(inGrid) - 0.5;
    }
    ++counts[*cell];
  }
  std::vector<float> displacements(size_t{3} * grid.cells());
  for (size_t cell = 0; cell < counts.size(); ++cell)
    for (int axis = 0; axis < 3 && counts[cell] >= kLeastPoints; ++axis)
      displacements[3 * cell + axis] = std::clamp(static_cast<float>(sums[cell][axis] / counts[cell]), -kReach, kReach);
  return displacements;
}

bool SurfaceSurvey::showSomethingIn(const Vec3d& low, const Vec3d& high) const {
  const int n = space_.gridResolution;
  int first[3], last[3];
  for (int axis = 0; axis < 3; ++axis) {
    // Cells that the box hardly reaches into are left out, because something seems to be in more of them than there is.
    constexpr double kReach = 0.125, kReachOfBox = 0.25;
    const double reach = std::min(kReach, kReachOfBox * (high[axis] - low[axis]));
    first[axis] = std::clamp(static_cast<int>(std::floor(low[axis] + reach)), 0, n - 1);
    last[axis] = std::clamp(static_cast<int>(std::floor(high[axis] - reach)), first[axis], n - 1);
  }
  for (int k = first[2]; k <= last[2]; ++k)
    for (int j = first[1]; j <= last[1]; ++j)
      for (int i = first[0]; i <= last[0]; ++i) {
        const int cell = i + n * (j + n * k);
        if ((cells_[static_cast<size_t>(cell / 32)] >> cell % 32 & 1) != 0) return true;
      }
  return false;
}

std::vector<bool> SurfaceSurvey::findCells(const MeshPart& part, const OctahedraDomain& domain) const {
  const int cells = static_cast<int>(domain.latticeCells()), corners = cells + 1;
  const auto inCoarseCells = [&](const Vec3d& inLattice) {
    const Vec3d at = frame_.sceneFromWorld(part.frame.worldFromScene(domain.fromLattice(inLattice)));
    Triple<double> x = {at.x(), at.y(), at.z()};
    if (space_.contracted) x = contract(x);
    const double half = space_.contracted ? 2 : 1;
    return Vec3d((Vec3d(x[0], x[1], x[2]) + Vec3d::Constant(half)) * (space_.gridResolution / (2 * half)));
  };
  // The corners of two layers of cells at a time.
  const auto cornersOfLayer = [&](int k) {
    std::vector<Vec3d> layer;
    for (int j = 0; j < corners; ++j)
      for (int i = 0; i < corners; ++i) layer.push_back(inCoarseCells(Vec3d(i, j, k)));
    return layer;
  };
  std::vector<bool> possible(static_cast<size_t>(cells) * cells * cells);
  std::vector<Vec3d> below = cornersOfLayer(0);
  for (int k = 0; k < cells; ++k) {
    std::vector<Vec3d> above = cornersOfLayer(k + 1);
    for (int j = 0; j < cells; ++j) {
      for (int i = 0; i < cells; ++i) {
        if (!domain.latticeCell(domain.fromLattice(Vec3d(i + 0.5, j + 0.5, k + 0.5)))) continue;
        Vec3d low = Vec3d::Constant(kNever), high = -low;
        for (const std::vector<Vec3d>* layer : {&below, &above})
          for (int corner = 0; corner < 4; ++corner) {
            const Vec3d& at = (*layer)[static_cast<size_t>(i + corner % 2 + corners * (j + corner / 2))];
            low = low.cwiseMin(at);
            high = high.cwiseMax(at);
          }
        possible[static_cast<size_t>(i + cells * (j + cells * k))] = showSomethingIn(low, high);
      }
    }
    below = std::move(above);
  }
  return possible;
}

MeshStart SurfaceSurvey::findStart(const MeshPart& part, const OctahedraDomain& domain) const {
  MeshStart start;
  start.cells = findCells(part, domain);

  // An occupancy has at least one cell; this one is for what shows the sky alone.
  if (part.isBackground() && std::find(start.cells.begin(), start.cells.end(), true) == start.cells.end())
    start.cells.front() = true;

  std::vector<double> pixelWidths;
  start.tiles.resize(photoCount_);
  constexpr float kReach = static_cast<float>(1 + kBlockMargin / (1 - 2 * kBlockMargin));  // half of the margin
  for (const Sight& sight : sights_) {
    const Vec3d eye = part.frame.sceneFromWorld(sight.eye), towards = part.frame.rotation * sight.towards;
    const double distance = sight.isSurface ? sight.distance * part.frame.scale : kNever;
    if (part.isBackground()) {
      const auto [enter, leave] = rangeInBox(eye, towards, part.halfEdges);
      if (enter < leave && distance <= leave) continue;
    } else {
      if (showsBehind(part, eye, towards, sight.clear * part.frame.scale)) addTile(start.through, sight.tile);
      if (!sight.isSurface) continue;
      if ((eye + distance * towards).cwiseAbs().maxCoeff() > kReach) continue;
    }
    addTile(start.tiles[static_cast<size_t>(sight.tile.photo)], sight.tile);
    if (sight.isSurface) pixelWidths.push_back(sight.pixelWidth * part.frame.scale);
  }
  if (!pixelWidths.empty()) start.pixelWidth = upperMedian(pixelWidths);
  return start;
}

}  // namespace tessera

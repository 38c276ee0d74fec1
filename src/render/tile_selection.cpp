#include "render/tile_selection.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <queue>
#include <set>

#include "base/check.h"

namespace tessera {

bool TileView::sees(const TileNode& tile) const {
  if (!window || tile.isBackgroundBlock) return true;
  // A box is outside if one plane through the eye separates all its corners; corners exactly on it count as inside.
  bool outside[5] = {true, true, true, true, true};
  for (int corner = 0; corner < 8; ++corner) {
    const Vec3d x(corner & 1 ? tile.high.x() : tile.low.x(), corner & 2 ? tile.high.y() : tile.low.y(),
                  corner & 4 ? tile.high.z() : tile.low.z());
    const Vec3d c = cameraFromScene * (x - eye);
    outside[4] &= c.z() < 0;
    for (const int axis : {0, 1}) {
      outside[2 * axis] &= c[axis] < window->low[axis] * c.z();
      outside[2 * axis + 1] &= c[axis] > window->high[axis] * c.z();
    }
  }
  return std::none_of(outside, outside + 5, [](bool o) { return o; });
}

double TileView::distance(const TileNode& tile) const {
  if (tile.isBackgroundBlock) {
    return std::max(nearest, std::min((eye - tile.low).head<2>().minCoeff(), (tile.high - eye).head<2>().minCoeff()));
  }
  return std::max(nearest, (eye - eye.cwiseMax(tile.low).cwiseMin(tile.high)).norm());
}

double TileView::errorInPixels(const TileNode& tile) const {
  return tile.geometricError * focal / distance(tile);
}

double TileView::areaInPixels(const TileNode& tile) const {
  if (tile.isBackgroundBlock) return backgroundBlockPixels;
  const double radius = 0.5 * (tile.high - tile.low).norm();
  const double onScreen = radius * focal / std::max(radius, distance(tile));
  return std::min(pixels, std::numbers::pi * onScreen * onScreen);
}

namespace {

// Returns the fraction of the image whose rays leave the box through a side or miss it.
double shareOfBackgroundBlock(const Camera& camera, const TileView& view, const TileFrame& frame) {
  constexpr int kAcross = 12;
  int shows = 0;
  for (int i = 0; i < kAcross * kAcross; ++i) {
    const Vec2d at((i % kAcross + 0.5) * camera.width / kAcross, (i / kAcross + 0.5) * camera.height / kAcross);
    const std::optional<Vec3d> d = camera.directionInCamera(at);
    shows += d && showsBackgroundBlock({view.eye, view.cameraFromScene.transpose() * *d}, frame.low, frame.high);
  }
  return static_cast<double>(shows) / (kAcross * kAcross);
}

}  // namespace

TileView tileView(const Camera& camera, const Pose& worldFromCamera, const TileFrame& frame) {
  TileView view;
  view.eye = frame.inScene(worldFromCamera.translation);
  view.cameraFromScene = worldFromCamera.rotation.transpose() * frame.rotation;
  view.focal = std::max(camera.focalX(), camera.focalY());
  view.pixels = static_cast<double>(camera.width) * camera.height;
  view.nearest = frame.near;
  view.backgroundBlockPixels = view.pixels * shareOfBackgroundBlock(camera, view, frame);
  if (lensSeesBehind(camera.lens)) return view;
  // A lens is a continuous map without folds, so the border of the image encloses it in x/z and y/z too.
  TileView::Window window{{INFINITY, INFINITY}, {-INFINITY, -INFINITY}};
  const auto add = [&](double x, double y) {
    const std::optional<Vec3d> d = camera.directionInCamera(Vec2d(x, y));
    if (!d || d->z() <= 1e-3) return false;
    for (const int axis : {0, 1}) {
      window.low[axis] = std::min(window.low[axis], (*d)[axis] / d->z());
      window.high[axis] = std::max(window.high[axis], (*d)[axis] / d->z());
    }
    return true;
  };
  for (int x = 0; x <= camera.width; ++x) {
    if (!add(x, 0) || !add(x, camera.height)) return view;
  }
  for (int y = 0; y <= camera.height; ++y) {
    if (!add(0, y) || !add(camera.width, y)) return view;
  }
  view.window = window;
  return view;
}

bool showsBackgroundBlock(const SceneRay& ray, const Vec3d& low, const Vec3d& high) {
  const RayRange inside = clipToBox(ray, low, high, {0, INFINITY});
  if (inside.empty()) return true;
  const double upwards = ray.direction.z();
  return upwards == 0 || ((upwards > 0 ? high : low).z() - ray.origin.z()) / upwards > inside.far;
}

namespace {

// Sums the memory of tiles: each shared resource is charged once, to the first tile that needs it.
class Charges {
 public:
  explicit Charges(const TileMemory& memory) : memory_(memory) {}

  uint64_t bytesWith(int tile) const {
    uint64_t bytes = bytes_ + memory_.bytes(tile);
    for (const int resource : memory_.tileResources(tile)) {
      if (!resources_.contains(resource)) bytes += memory_.bytesOfResource(resource);
    }
    return bytes;
  }
  void add(int tile) {
    bytes_ = bytesWith(tile);
    for (const int resource : memory_.tileResources(tile)) resources_.insert(resource);
  }

 private:
  const TileMemory& memory_;
  uint64_t bytes_ = 0;
  std::set<int> resources_;
};

}  // namespace

struct TileSelector::Pass {
  const TileView& view;
  const std::function<bool(int)>& holds;
  std::vector<SelectedTile> tiles;
};

TileSelector::TileSelector(const TileTree& tree, SelectionSettings settings)
    : tree_(tree), settings_(settings), pinned_(tree.coarsest()), replaced_(tree.tiles.size()) {
  tree.check();
  if (settings_.hysteresis == 0) settings_.hysteresis = kUsualHysteresis;
  CHECK(settings_.hysteresis >= 1.0);
  if (tree.backgroundBlock >= 0) pinned_.push_back(tree.backgroundBlock);
}

TileChoice TileSelector::choose(const TileView& view, const TileMemory& memory) {
  struct Candidate {
    int tile;
    double priority, distance;
    bool operator<(const Candidate& other) const {  // true if less urgent
      if (priority != other.priority) return priority < other.priority;
      return distance != other.distance ? distance > other.distance : tile > other.tile;
    }
  };
  std::priority_queue<Candidate> open;
  // A tile is urgent if it covers much of the image and what is drawn there is far coarser than requested.
  const std::function<void(int, double)> addBelow = [&](int tile, double error) {
    for (const int child : tree_.tiles[tile].children) {
      const TileNode& node = tree_.tiles[child];
      if (!view.sees(node)) continue;
      if (!node.hasContent) {
        addBelow(child, error);
        continue;
      }
      const double residencyBonus = memory.holds(child) ? settings_.hysteresis * settings_.hysteresis : 1;
      open.push({child, view.areaInPixels(node) * error * residencyBonus, view.distance(node)});
    }
  };
  const auto refine = [&](int tile) {
    if (!isReplaced(view, tile)) return;
    addBelow(tile, view.errorInPixels(tree_.tiles[tile]) / std::max(settings_.maximumScreenSpaceError, 1e-3));
  };
  TileChoice choice;
  Charges charges(memory);
  for (const int tile : pinned_) {
    charges.add(tile);
    if (view.sees(tree_.tiles[tile])) refine(tile);
  }
  while (!open.empty()) {
    const int tile = open.top().tile;
    open.pop();
    if (charges.bytesWith(tile) > memory.budget) {
      ++choice.refused;
      if (isReplaced(view, tile)) lookBelow(view, tile);
      continue;
    }
    charges.add(tile);
    choice.requested.push_back(tile);
    refine(tile);
  }
  return choice;
}

// Updates the replacement state of tiles below, so that it does not depend on the budget.
void TileSelector::lookBelow(const TileView& view, int tile) {
  for (const int child : tree_.tiles[tile].children) {
    const TileNode& node = tree_.tiles[child];
    if (view.sees(node) && (!node.hasContent || isReplaced(view, child))) lookBelow(view, child);
  }
}

// Adds tiles to the cut that cover this one; `above` is the nearest resident content above it.
void TileSelector::cover(Pass& pass, int tile, int above) {
  const TileNode& node = tree_.tiles[tile];
  if (!pass.view.sees(node) || (!node.hasContent && node.children.empty())) {
    pass.tiles.push_back({tile, -1, false});
    return;
  }
  const bool isHeld = node.hasContent && pass.holds(tile);
  const int content = isHeld ? tile : above;
  if (!node.children.empty() && (!isHeld || isReplaced(pass.view, tile))) {
    const size_t before = pass.tiles.size();
    for (const int child : tree_.childrenFrontToBack(tile, pass.view.eye)) cover(pass, child, content);
    const auto first = pass.tiles.begin() + static_cast<std::ptrdiff_t>(before), end = pass.tiles.end();
    const bool anyVisible = std::any_of(first, end, [](const SelectedTile& one) { return one.visible; });
    const auto isFiner = [&](const SelectedTile& one) { return one.visible && one.content != content; };
    if (!anyVisible || std::any_of(first, end, isFiner)) return;
    pass.tiles.resize(before);  // no finer content is resident
  }
  pass.tiles.push_back({tile, content, content >= 0});
}

bool TileSelector::isReplaced(const TileView& view, int tile) {
  const TileNode& node = tree_.tiles[tile];
  const double threshold = settings_.maximumScreenSpaceError / (replaced_[tile] ? settings_.hysteresis : 1);
  const bool canBe = !node.children.empty() && node.level > settings_.finestLevel;
  replaced_[tile] = canBe && view.errorInPixels(node) > threshold;
  return replaced_[tile] != 0;
}

TileCut TileSelector::cut(const TileView& view, const std::function<bool(int)>& holds) {
  for (const int tile : pinned_) CHECK(holds(tile) == true);
  TileCut cut;
  Pass pass{view, holds, {}};
  if (tree_.backgroundBlock >= 0) {
    cover(pass, tree_.backgroundBlock, -1);
    cut.backgroundBlock = pass.tiles.front().content;
    pass.tiles.clear();
  }
  cover(pass, 0, -1);
  cut.tiles = std::move(pass.tiles);
  return cut;
}

}  // namespace tessera

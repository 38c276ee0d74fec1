#include "render/tile_selection.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/check.h"

namespace tessera {

bool TileView::sees(const TileNode& tile) const {
  if (!window || tile.isSurround) return true;
  // Outside of one plane through the eye with all corners; corners exactly on it count as inside.
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
  if (tile.isSurround) {
    return std::max(nearest, std::min((eye - tile.low).head<2>().minCoeff(), (tile.high - eye).head<2>().minCoeff()));
  }
  return std::max(nearest, (eye - eye.cwiseMax(tile.low).cwiseMin(tile.high)).norm());
}

double TileView::errorInPixels(const TileNode& tile) const {
  return tile.geometricError * focal / distance(tile);
}

double TileView::areaInPixels(const TileNode& tile) const {
  if (tile.isSurround) return pixels;
  const double radius = 0.5 * (tile.high - tile.low).norm();
  const double onScreen = radius * focal / std::max(radius, distance(tile));
  return std::min(pixels, std::numbers::pi * onScreen * onScreen);
}

TileView tileView(const Camera& camera, const Pose& worldFromCamera, const VolumeFrame& frame) {
  TileView view;
  view.eye = frame.inScene(worldFromCamera.translation);
  view.cameraFromScene = worldFromCamera.rotation.transpose() * frame.rotation;
  view.focal = std::max(camera.focalX(), camera.focalY());
  view.pixels = static_cast<double>(camera.width) * camera.height;
  view.nearest = frame.near;
  if (lensSeesBehind(camera.lens)) return view;
  // A lens is a continuous map without folds: the border of the picture encloses it in x/z and y/z too.
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

struct TileSelector::Pass {
  const TileView& view;
  const std::function<bool(int)>& loaded;
  Selection selection;

  void request(std::vector<int> tiles, std::vector<int> beside, const TileNode& instead, double mostPixels) {
    const double error = view.errorInPixels(instead) / std::max(mostPixels, 1e-3);
    selection.requests.push_back(
        {std::move(tiles), std::move(beside), view.areaInPixels(instead) * error, view.distance(instead)});
  }
};

TileSelector::TileSelector(const TileTree& tree, SelectionSettings settings)
    : tree_(tree), settings_(settings), replaced_(tree.tiles.size()) {
  tree.check();
  CHECK(settings.hysteresis >= 1.0);
}

// Adds tiles to the cut that cover this one. Where there are none in memory: false, and adds those that would do.
bool TileSelector::cover(Pass& pass, int tile, std::vector<int>& missing) {
  const TileNode& node = tree_.tiles[tile];
  if (!pass.view.sees(node) || (!node.hasContent && node.children.empty())) {
    pass.selection.cut.push_back({tile, false});
    return true;
  }
  if (!node.hasContent) {
    replaced_[tile] = true;
  } else if (node.children.empty() || node.level <= settings_.finestLevel) {
    replaced_[tile] = false;
  } else {
    const double threshold = settings_.mostPixels / (replaced_[tile] ? settings_.hysteresis : 1);
    replaced_[tile] = pass.view.errorInPixels(node) > threshold;
  }
  const bool replaced = replaced_[tile], loaded = node.hasContent && pass.loaded(tile);
  if (!node.children.empty() && (replaced || !loaded)) {
    Selection& made = pass.selection;
    const size_t cutBefore = made.cut.size(), requestsBefore = made.requests.size();
    std::vector<int> missingBelow;
    bool covered = true;
    for (const int child : tree_.childrenFrontToBack(tile, pass.view.eye)) {
      covered &= cover(pass, child, missingBelow);
    }
    if (covered) {
      if (!replaced) pass.request({tile}, {}, node, settings_.mostPixels);  // finer than need be
      return true;
    }
    if (!node.hasContent) {
      missing.insert(missing.end(), missingBelow.begin(), missingBelow.end());
      return false;  // what covers other children stays in the cut for whoever asks what to keep
    }
    std::vector<int> beside;
    for (size_t i = cutBefore; i < made.cut.size(); ++i) {
      if (made.cut[i].visible) beside.push_back(made.cut[i].tile);
    }
    made.cut.resize(cutBefore);
    made.requests.resize(requestsBefore);
    if (loaded) pass.request(std::move(missingBelow), std::move(beside), node, settings_.mostPixels);
  }
  if (loaded) {
    pass.selection.cut.push_back({tile, true});
  } else {
    missing.push_back(tile);
  }
  return loaded;
}

Selection TileSelector::select(const TileView& view, const std::function<bool(int)>& loaded) {
  for (const int tile : tree_.coarsest()) CHECK(loaded(tile) == true);
  Pass pass{view, loaded, {}};
  std::vector<int> missing;
  CHECK(cover(pass, 0, missing) == true);
  if (tree_.surround >= 0) {
    CHECK(cover(pass, tree_.surround, missing) == true);
    pass.selection.surround = pass.selection.cut.back().tile;
    pass.selection.cut.pop_back();
  }
  std::stable_sort(pass.selection.requests.begin(), pass.selection.requests.end(),
                   [](const TileRequest& a, const TileRequest& b) {
                     return a.priority != b.priority ? a.priority > b.priority : a.distance < b.distance;
                   });
  return std::move(pass.selection);
}

}  // namespace tessera

#include "golden/golden_selection.h"

#include <set>

#include "base/random.h"
#include "render/testing/test_tree.h"
#include "render/tile_selection.h"

namespace tessera::golden {
namespace {

using nlohmann::ordered_json;

constexpr int kViews = 120;

ordered_json toJson(const Vec3d& x) {
  return {x.x(), x.y(), x.z()};
}

// A tree with numbers of columns and rows that are no powers of two, tiles without content, and two background blocks.
TileTree tree() {
  TileTree tree = testTree(6, 5);
  for (size_t i = 5; i < tree.tiles.size(); i += 9) tree.tiles[i].hasContent = false;
  TileNode around;
  around.isBackgroundBlock = true;
  around.low = tree.tiles[0].low;
  around.high = tree.tiles[0].high;
  around.level = 1;
  around.geometricError = 0.08;
  tree.backgroundBlock = static_cast<int>(tree.tiles.size());
  around.children = {tree.backgroundBlock + 1};
  tree.tiles.push_back(around);
  around.parent = tree.backgroundBlock;
  around.children.clear();
  around.level = 0;
  around.geometricError /= 2;
  tree.tiles.push_back(around);
  return tree;
}

ordered_json toJson(const TileTree& tree) {
  ordered_json tiles = ordered_json::array();
  for (const TileNode& node : tree.tiles) {
    const TileCells& cells = node.cells;
    tiles.push_back({{"parent", node.parent},
                     {"children", node.children},
                     {"cells", {cells.i0, cells.j0, cells.i1, cells.j1}},
                     {"low", toJson(node.low)},
                     {"high", toJson(node.high)},
                     {"geometricError", node.geometricError},
                     {"level", node.level},
                     {"hasContent", node.hasContent},
                     {"isBackgroundBlock", node.isBackgroundBlock}});
  }
  return {{"columns", tree.columns}, {"rows", tree.rows}, {"backgroundBlock", tree.backgroundBlock}, {"tiles", tiles}};
}

}  // namespace

ordered_json makeSelections() {
  const TileTree tileTree = tree();
  TileFrame frame;
  frame.low = tileTree.tiles[0].low;
  frame.high = tileTree.tiles[0].high;
  const auto bytes = [](int tile) { return static_cast<uint64_t>(100 + 37 * tile % 61); };
  TileSelector selector(tileTree, {});  // shared by all views, as the replacement state carries over
  // The same views, with tiles that share resources, such as networks.
  const auto tileResources = [](int tile) { return std::vector<int>{tile % 5, 5 + tile % 3}; };
  const auto bytesOfResource = [](int resource) { return static_cast<uint64_t>(60 + 90 * resource % 170); };
  TileSelector sharing(tileTree, {});
  const RandomStream random(17, 1);
  ordered_json views = ordered_json::array();
  for (uint64_t i = 0; i < kViews; ++i) {
    const auto value = [&](uint64_t k) { return 2 * random.uniformDouble(200 * i + k) - 1; };
    Camera camera;
    camera.width = 480;
    camera.height = 270;
    const double focal = 300 + 100 * value(0);
    camera.parameters = {focal, focal, 240, 135};
    Pose pose;
    pose.translation = Vec3d(8 * value(1), 7 * value(2), 0.1 + 4 * std::abs(value(3)));
    const Vec3d forward = (Vec3d(5 * value(4), 4 * value(5), 0.3 * value(6)) - pose.translation).normalized();
    pose.rotation.col(0) = forward.cross(Vec3d::UnitZ()).normalized();
    pose.rotation.col(1) = forward.cross(pose.rotation.col(0));
    pose.rotation.col(2) = forward;
    std::set<int> resident = {0, tileTree.backgroundBlock};
    for (size_t tile = 1; tile < tileTree.tiles.size(); ++tile) {
      if (tileTree.tiles[tile].hasContent && value(10 + tile) > 0) resident.insert(static_cast<int>(tile));
    }
    const auto holds = [&](int tile) { return resident.contains(tile); };
    const uint64_t budget = 300 + random.below(200 * i + 9, 4000);
    const TileView view = tileView(camera, pose, frame);
    const TileChoice choice = selector.choose(view, {budget, holds, bytes});
    const TileCut cut = selector.cut(view, holds);
    const TileChoice shared = sharing.choose(view, {budget, holds, bytes, tileResources, bytesOfResource});
    ordered_json tiles = ordered_json::array();
    for (const SelectedTile& one : cut.tiles) {
      if (one.visible) tiles.push_back({one.tile, one.content});
    }
    views.push_back({{"camera",
                      {{"focal", focal},
                       {"width", camera.width},
                       {"height", camera.height},
                       {"eye", toJson(pose.translation)},
                       {"right", toJson(pose.rotation.col(0))},
                       {"down", toJson(pose.rotation.col(1))},
                       {"forward", toJson(pose.rotation.col(2))}}},
                     {"resident", resident},
                     {"budget", budget},
                     {"requested", choice.requested},
                     {"refused", choice.refused},
                     {"sharing", {{"requested", shared.requested}, {"refused", shared.refused}}},
                     {"cut", tiles},
                     {"backgroundBlock", cut.backgroundBlock}});
  }
  ordered_json sizes = ordered_json::array();
  ordered_json resources = ordered_json::array(), resourceSizes = ordered_json::array();
  for (size_t tile = 0; tile < tileTree.tiles.size(); ++tile) {
    sizes.push_back(bytes(static_cast<int>(tile)));
    resources.push_back(tileResources(static_cast<int>(tile)));
  }
  for (int resource = 0; resource < 8; ++resource) resourceSizes.push_back(bytesOfResource(resource));
  return {{"frame", {{"near", frame.near}, {"low", toJson(frame.low)}, {"high", toJson(frame.high)}}},
          {"tree", toJson(tileTree)},
          {"bytes", sizes},
          {"resources", resources},
          {"bytesOfResources", resourceSizes},
          {"views", views}};
}

}  // namespace tessera::golden

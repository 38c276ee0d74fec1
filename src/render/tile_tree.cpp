#include "render/tile_tree.h"

#include <algorithm>
#include <cstdlib>

#include "base/check.h"

namespace tessera {
namespace {

// The lower ends of columns (axis 0) or rows (1), ascending.
std::vector<double> startsOf(const TileTree& tree, const TileNode& node, int axis) {
  std::vector<double> starts;
  for (const int child : node.children) starts.push_back(tree.tiles[child].low[axis]);
  std::sort(starts.begin(), starts.end());
  const double rounding = 1e-6 * (node.high[axis] - node.low[axis]);
  starts.erase(std::unique(starts.begin(), starts.end(), [&](double a, double b) { return b - a <= rounding; }),
               starts.end());
  return starts;
}

// The last that begins at x or before; the first where none does.
int indexAt(const std::vector<double>& starts, double x) {
  const auto after = std::upper_bound(starts.begin(), starts.end(), x);
  return std::max(0, static_cast<int>(after - starts.begin()) - 1);
}

}  // namespace

std::vector<int> TileTree::childrenFrontToBack(int tile, const Vec3d& eye) const {
  const TileNode& node = tiles[tile];
  std::vector<std::pair<int, int>> byDistance;
  std::vector<double> starts[2];
  for (const int axis : {0, 1}) starts[axis] = startsOf(*this, node, axis);
  for (const int child : node.children) {
    int distance = 0;
    for (const int axis : {0, 1}) {
      const double middle = 0.5 * (tiles[child].low[axis] + tiles[child].high[axis]);
      distance += std::abs(indexAt(starts[axis], middle) - indexAt(starts[axis], eye[axis]));
    }
    byDistance.emplace_back(distance, child);
  }
  std::sort(byDistance.begin(), byDistance.end());
  std::vector<int> order;
  for (const auto& [distance, child] : byDistance) order.push_back(child);
  return order;
}

std::vector<int> TileTree::coarsest() const {
  std::vector<int> found;
  std::vector<char> covered(tiles.size());  // by a content of the tile or above it
  for (size_t i = 0; i < tiles.size(); ++i) {
    const TileNode& node = tiles[i];
    if (static_cast<int>(i) == surround) continue;
    const bool above = node.parent >= 0 && covered[node.parent];
    if (node.hasContent && !above) found.push_back(static_cast<int>(i));
    covered[i] = above || node.hasContent;
  }
  return found;
}

void TileTree::check() const {
  CHECK(tiles.empty() == false);
  CHECK(surround < static_cast<int>(tiles.size()));
  for (size_t i = 0; i < tiles.size(); ++i) {
    const TileNode& node = tiles[i];
    CHECK(node.parent < static_cast<int>(i));
    CHECK((node.parent >= 0 || i == 0 || static_cast<int>(i) == surround) == true);
    for (const int child : node.children) {
      CHECK(child > static_cast<int>(i));
      CHECK(child < static_cast<int>(tiles.size()));
      CHECK(tiles[child].parent == static_cast<int>(i));
    }
  }
}

}  // namespace tessera

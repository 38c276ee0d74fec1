#include "golden/golden_mesh.h"

#include <algorithm>
#include <cmath>
#include <functional>

#include "base/random.h"
#include "tiles/bc4.h"

namespace tessera::golden {
namespace {

// Returns the height of the ground.
double groundAt(double x, double y) {
  return -0.45 + 0.12 * noise(1, 1.5 * x, 1.5 * y);
}

// Opacities in [0,1] by the place in the scene and, in [0,1], in the patch.
using OpacityFunction = std::function<double(const Vec3d& place, double column, double row)>;

double solid(const Vec3d&, double, double) {
  return 1;
}
double halfTransparent(const Vec3d& place, double, double) {
  return 0.45 + 0.4 * noise(90, 3 * place.x() + place.z(), 3 * place.y() - 2 * place.z());
}
// Solid at its border, with a hole in its middle.
double window(const Vec3d&, double column, double row) {
  return 5 * std::max(std::abs(column - 0.5), std::abs(row - 0.5)) - 1.6;
}

// A patch before it is encoded.
struct Quad {
  std::array<Vec3d, 4> corners;  // as those of a patch
  OpacityFunction opacity = solid;
  bool isPair = true;

  Vec3d place(double column, double row) const {
    if (isPair && column + row > 1)
      return corners[3] + (1 - column) * (corners[2] - corners[3]) + (1 - row) * (corners[1] - corners[3]);
    return corners[0] + column * (corners[1] - corners[0]) + row * (corners[2] - corners[0]);
  }
};

constexpr double kNoBuilding = INFINITY;

class QuadList {
 public:
  // Every fifth quad becomes two patches with one triangle each.
  void add(const Quad& quad) {
    if (++count_ % 5 != 0) {
      quads_.push_back(quad);
      return;
    }
    const auto& [a, b, c, d] = quad.corners;
    quads_.push_back({{a, b, c, d}, quad.opacity, false});
    quads_.push_back({{d, c, b, a}, quad.opacity, false});
  }
  // Adds a parallelogram as `columns` × `rows` patches.
  void addGrid(const Vec3d& corner, const Vec3d& right, const Vec3d& up, int columns, int rows,
               const OpacityFunction& opacity) {
    const auto at = [&](int i, int j) -> Vec3d {
      return corner + static_cast<double>(i) / columns * right + static_cast<double>(j) / rows * up;
    };
    for (int j = 0; j < rows; ++j)
      for (int i = 0; i < columns; ++i) add({{at(i, j), at(i + 1, j), at(i, j + 1), at(i + 1, j + 1)}, opacity});
  }
  // Adds ground between x0 and x1, y0 and y1, raised by `height`, except for patches below the building around
  // (building, 0).
  void addGround(double x0, double x1, double y0, double y1, int columns, int rows, double height, double building,
                 const OpacityFunction& opacity) {
    const auto at = [&](int i, int j) -> Vec3d {
      const double x = x0 + (x1 - x0) * i / columns, y = y0 + (y1 - y0) * j / rows;
      return {x, y, groundAt(x, y) + height};
    };
    const auto isBelow = [&](const Vec3d& place) {
      return std::abs(place.x() - building) < kHalfLength && std::abs(place.y()) < kHalfWidth;
    };
    for (int j = 0; j < rows; ++j)
      for (int i = 0; i < columns; ++i) {
        const Quad quad = {{at(i, j), at(i + 1, j), at(i, j + 1), at(i + 1, j + 1)}, opacity};
        if (!std::all_of(quad.corners.begin(), quad.corners.end(), isBelow)) add(quad);
      }
  }
  // Adds a building around (x, 0), whose walls have windows.
  void addBuilding(double x, double roof, int columns) {
    const double bottom = -0.6, height = roof - bottom;
    const Vec3d low(x - kHalfLength, -kHalfWidth, bottom), up(0, 0, height);
    const Vec3d length(2 * kHalfLength, 0, 0), width(0, 2 * kHalfWidth, 0);
    addGrid(low + up, length, width, columns, 1, solid);
    addGrid(low, length, up, columns, 1, window);
    addGrid(low + width, length, up, columns, 1, window);
    addGrid(low, width, up, 1, 1, window);
    addGrid(low + length, width, up, 1, 1, window);
  }
  // Adds upright half-transparent patches across the way of low rays along x.
  void addFences(double x, int count) {
    for (int i = 0; i < count; ++i) {
      const double at = x - 0.7 + 1.3 * i / count;
      addGrid({at, 0.4, -0.55}, {0.1, 0.55, 0}, {0, 0.03, 0.35}, 1, 1, halfTransparent);
    }
  }

  const std::vector<Quad>& quads() const { return quads_; }

 private:
  static constexpr double kHalfLength = 0.4, kHalfWidth = 0.3;  // of a building

  std::vector<Quad> quads_;
  int count_ = 0;
};

// How the numbers of vertices stand for places.
struct Placement {
  std::array<double, 3> origin;
  double step;
};

class PatchSetMaker {
 public:
  PatchSetMaker(const std::vector<Quad>& quads, uint32_t patchEdge, const Placement& placement) : quads_(quads) {
    std::stable_partition(quads_.begin(), quads_.end(), [](const Quad& quad) { return quad.isPair; });
    set_.patchEdge = patchEdge;
    set_.patches = static_cast<uint32_t>(quads_.size());
    set_.pairs = static_cast<uint32_t>(
        std::count_if(quads_.begin(), quads_.end(), [](const Quad& quad) { return quad.isPair; }));
    set_.origin = placement.origin;
    set_.step = placement.step;
    for (size_t f = 0; f < kMeshFeatures; ++f) {
      const float size = 1 + 0.25f * static_cast<float>(f);
      set_.ranges[f] = {-size, size + 0.5f};
    }
  }

  PatchSet make(uint64_t seed) {
    for (Quad& quad : quads_) addVertices(quad);
    makeTextures();
    const RandomStream random(seed, 7);
    uint64_t next = 0;
    set_.decoder = makeNetwork(kMeshFeatures + kMeshHarmonics, random, next);
    return set_;
  }

 private:
  // Also rounds the corners. Corner 3 of a single patch has no meaning, and readers must ignore it.
  void addVertices(Quad& quad) {
    for (size_t corner = 0; corner < 4; ++corner) {
      const bool isIgnored = corner == 3 && !quad.isPair;
      for (size_t axis = 0; axis < 3; ++axis) {
        double& place = quad.corners[corner][static_cast<Eigen::Index>(axis)];
        const double number = std::floor((place - set_.origin[axis]) / set_.step + 0.5);
        set_.vertices.push_back(isIgnored ? UINT16_MAX : static_cast<uint16_t>(std::clamp(number, 0.0, 65535.0)));
        place = set_.origin[axis] + set_.step * set_.vertices.back();
      }
    }
  }

  void makeTextures() {
    const uint32_t width = set_.textureWidth(), height = set_.textureHeight(), edge = set_.patchEdge;
    std::array<std::vector<uint8_t>, kMeshFeatures + 1> images;  // opacity last
    for (std::vector<uint8_t>& image : images) image.resize(size_t{width} * height);
    for (uint32_t y = 0; y < height; ++y) {
      for (uint32_t x = 0; x < width; ++x) {
        const uint32_t patch = y / edge * set_.patchesAcross() + x / edge;
        if (patch >= set_.patches) continue;
        const double column = static_cast<double>(x % edge) / (edge - 1),
                     row = static_cast<double>(y % edge) / (edge - 1);
        const Vec3d at = quads_[patch].place(column, row);
        const size_t texel = x + size_t{width} * y;
        for (size_t f = 0; f < kMeshFeatures; ++f) {
          const double value = noise(100 + f, 2 * at.x() + at.z(), 2 * at.y() - 0.5 * at.z());
          images[f][texel] = set_.ranges[f].encode(1.25f * static_cast<float>(value));
        }
        images[kMeshFeatures][texel] = opacityByte(quads_[patch].opacity(at, column, row));
      }
    }
    for (size_t f = 0; f < kMeshFeatures; f += 2) set_.featureBlocks[f / 2] = interleave(images[f], images[f + 1]);
    set_.opacityBlocks = encodeBc4Image(images[kMeshFeatures], width, height, Bc4Effort::exhaustive);
  }

  // Large opacities are written as 1, and very small ones as 0.
  static uint8_t opacityByte(double opacity) {
    if (opacity >= 0.8) return 255;
    return opacity < 0.05 ? 0 : static_cast<uint8_t>(std::floor(255 * opacity + 0.5));
  }

  // Returns the blocks of a texture of two channels.
  std::vector<uint8_t> interleave(const std::vector<uint8_t>& red, const std::vector<uint8_t>& green) const {
    const uint32_t width = set_.textureWidth(), height = set_.textureHeight();
    const std::vector<uint8_t> reds = encodeBc4Image(red, width, height, Bc4Effort::fast),
                               greens = encodeBc4Image(green, width, height, Bc4Effort::fast);
    std::vector<uint8_t> both;
    for (size_t at = 0; at < reds.size(); at += 8) {
      both.insert(both.end(), reds.begin() + static_cast<ptrdiff_t>(at), reds.begin() + static_cast<ptrdiff_t>(at) + 8);
      both.insert(both.end(), greens.begin() + static_cast<ptrdiff_t>(at),
                  greens.begin() + static_cast<ptrdiff_t>(at) + 8);
    }
    return both;
  }

  std::vector<Quad> quads_;
  PatchSet set_;
};

// Vertices of a block are at whole multiples of a step that is no power of two.
Placement blockPlacement(uint32_t column) {
  return {{column == 0 ? -2.7 : -0.7, -1.3, -0.9}, 3.4 / UINT16_MAX};
}

// Of the two blocks, at the finest level. On both sides of the wall between them, each has a strip of thin ground, at
// different heights, so that rays meet the two contents in turns.
PatchSet makeFineBlock(uint32_t column) {
  QuadList quads;
  const double x = column == 0 ? -1 : 1;
  const int cells = column == 0 ? 8 : 6;
  quads.addGround(x - 1, x + 1, -1, 1, cells, cells, 0, x, solid);
  quads.addBuilding(x, column == 0 ? 0.45 : 0.1, 2);
  quads.addFences(x, 3);
  quads.addGround(-0.3, 0.3, -1, 1, 2, 6, column == 0 ? 0.03 : 0.06, kNoBuilding, halfTransparent);
  if (column == 0) {
    // A half-transparent wall outside the scene's box, which rays from there meet in front of the box.
    quads.addGrid({-2.3, -0.9, -0.7}, {0.05, 1.8, 0}, {0, 0, 1.5}, 1, 2, halfTransparent);
  } else {
    // Something above the box.
    quads.addGrid({0.2, -0.8, 0.95}, {1.5, 0, 0.1}, {0, 1.6, 0}, 2, 2, halfTransparent);
  }
  return PatchSetMaker(quads.quads(), column == 0 ? 8 : 12, blockPlacement(column)).make(column + 1);
}

// Parts of the merged level share the strip at the wall between them: their hits on it are at equal distances. All
// numbers are multiples of a power of two, so that both parts have it at exactly the same place.
PatchSet makeCoarseBlock(uint32_t column) {
  QuadList quads;
  const double x = column == 0 ? -1 : 1;
  quads.addGround(-0.5, 0.5, -1, 1, 2, 4, 0.06, kNoBuilding, halfTransparent);
  quads.addGround(x - 1, x + 1, -1, 1, 4, 4, 0, x, solid);
  quads.addBuilding(x, column == 0 ? 0.45 : 0.1, 1);
  quads.addFences(x, 2);
  if (column == 0) quads.addGrid({-2.3, -0.9, -0.7}, {0.05, 1.8, 0}, {0, 0, 1.5}, 1, 1, halfTransparent);
  const Placement placement = {{column == 0 ? -2.5 : -0.5, -1.25, -1}, 1.0 / 16384};
  return PatchSetMaker(quads.quads(), 8, placement).make(column + 3);
}

// The ground and, at its end, hills around the scene's box: rings of patches. `points`: around a ring, a multiple of 4.
PatchSet makeBackgroundPart(const std::vector<double>& radii, int points, uint64_t seed) {
  QuadList quads;
  // Returns a point of the rectangle that is `radius` times as large as the scene's box.
  const auto onRing = [&](double radius, int number) -> Vec3d {
    const int side = number % points / (points / 4);
    const double along = 2.0 * (number % (points / 4)) / (points / 4) - 1;
    const double u = side == 0 ? along : side == 1 ? 1 : side == 2 ? -along : -1;
    const double v = side == 0 ? -1 : side == 1 ? along : side == 2 ? 1 : -along;
    const Vec3d at(2 * radius * u, radius * v, 0);
    return {at.x(), at.y(), radius < 4 ? groundAt(at.x(), at.y()) : -0.45};
  };
  for (int i = 0; i < points; ++i) {
    for (size_t ring = 0; ring + 1 < radii.size(); ++ring) {
      const bool isThin = ring == 1 && i % 3 == 0;
      quads.add({{onRing(radii[ring], i), onRing(radii[ring], i + 1), onRing(radii[ring + 1], i),
                  onRing(radii[ring + 1], i + 1)},
                 isThin ? halfTransparent : solid});
    }
    const Vec3d left = onRing(radii.back(), i), right = onRing(radii.back(), i + 1), up(0, 0, 0.15 * radii.back());
    quads.add({{left, right, left + up, right + up}, halfTransparent});
  }
  // A sheet through the box, of which only what lies behind the box may be seen.
  quads.addGrid({-3.5, -0.9, 0.2}, {7, 0.2, 0.1}, {0, 1.6, 0.4}, 3, 1, halfTransparent);
  const double reach = 2.1 * radii.back();
  return PatchSetMaker(quads.quads(), 8, {{-reach, -reach, -reach / 4}, 2 * reach / UINT16_MAX}).make(seed);
}

MeshContent makeBackground(std::vector<double> radii, int points, uint64_t seed, uint32_t skyEdge) {
  MeshContent content;
  content.isBackground = true;
  content.parts = {makeBackgroundPart(radii, points, seed)};
  content.skyEdge = skyEdge;
  const RandomStream random(seed, 8);
  for (uint32_t i = 0; i < 18 * skyEdge * skyEdge; ++i)
    content.sky.push_back(static_cast<uint8_t>(128 + random.below(i, 128)));
  return content;
}

// Returns the box around all vertices that have a meaning.
SceneBox boxAround(const MeshContent& content) {
  SceneBox box = {Vec3d::Constant(INFINITY), Vec3d::Constant(-INFINITY)};
  for (const PatchSet& part : content.parts) {
    for (uint32_t patch = 0; patch < part.patches; ++patch) {
      for (uint32_t corner = 0; corner < (patch < part.pairs ? 4u : 3u); ++corner) {
        box.low = box.low.cwiseMin(part.corner(patch, corner));
        box.high = box.high.cwiseMax(part.corner(patch, corner));
      }
    }
  }
  return box;
}

}  // namespace

Scene<MeshContent> makeMeshScene() {
  Scene<MeshContent> scene;
  scene.contents["0_0"].parts = {makeFineBlock(0)};
  scene.contents["1_0"].parts = {makeFineBlock(1)};
  scene.contents["all"].parts = {makeCoarseBlock(0), makeCoarseBlock(1)};
  scene.contents["background_block"] = makeBackground({1, 1.5, 2.5, 6, 20}, 12, 5, 6);
  scene.contents["coarse_background_block"] = makeBackground({1, 2, 5, 20}, 8, 6, 0);
  // Of a block of 8 × 8 patches of 8 texels each.
  scene.tileset = landscapeTileset(kMeshName, 56);
  std::vector<Tile>& tiles = scene.tileset.tiles;
  tiles[1].box = tiles[1].contents[0].box = boxAround(scene.contents.at("0_0"));
  tiles[2].box = tiles[2].contents[0].box = boxAround(scene.contents.at("1_0"));
  tiles[0].box = tiles[0].contents[0].box = boxAround(scene.contents.at("all"));
  for (const size_t child : {1u, 2u}) {
    tiles[0].box.low = tiles[0].box.low.cwiseMin(tiles[child].box.low);
    tiles[0].box.high = tiles[0].box.high.cwiseMax(tiles[child].box.high);
  }
  return scene;
}

MeshSums computeSums(const PatchSet& part) {
  MeshSums sums;
  sums.patches = part.patches;
  sums.pairs = part.pairs;
  std::vector<uint8_t> bytes;
  for (const uint16_t number : part.vertices) {
    bytes.push_back(static_cast<uint8_t>(number & 255));
    bytes.push_back(static_cast<uint8_t>(number >> 8));
  }
  sums.vertices = computeSums(bytes);
  bytes.clear();
  for (const std::vector<uint8_t>& blocks : part.featureBlocks) bytes.insert(bytes.end(), blocks.begin(), blocks.end());
  sums.features = computeSums(bytes);
  sums.opacity = computeSums(part.opacityBlocks);
  return sums;
}

nlohmann::ordered_json toJson(const MeshSums& sums) {
  return {{"patches", sums.patches},       {"pairs", sums.pairs},
          {"vertices", sums.vertices.sum}, {"verticesOrdered", sums.vertices.ordered},
          {"features", sums.features.sum}, {"featuresOrdered", sums.features.ordered},
          {"opacity", sums.opacity.sum},   {"opacityOrdered", sums.opacity.ordered}};
}

}  // namespace tessera::golden

// For tests: one ray through contents of `mesh`, computed straight from docs/tile-format.md, section 8, in double
// precision and without acceleration. Of the contents it uses nothing but their numbers and bytes.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <tuple>
#include <vector>

#include "render/tile_frame.h"
#include "representations/mesh/content/mesh_content.h"
#include "tiles/bc4.h"

namespace tessera {

// A content of a tile, of which hits count whose x and y are in [low, high).
struct ReferenceMeshBlock {
  const MeshContent* content = nullptr;
  std::array<double, 2> low = {-INFINITY, -INFINITY}, high = {INFINITY, INFINITY};
};

// What a ray may meet. Lengths are in scene units.
struct ReferenceMeshView {
  std::vector<ReferenceMeshBlock> blocks;
  const MeshContent* background = nullptr;  // the background block, if there is one
  double near = 0.05;
  Vec3d low = Vec3d::Constant(-1), high = Vec3d::Constant(1);  // the scene's box
  double model = INFINITY;                                     // the distance of an ordinary model
};

struct ReferenceMeshHit {
  bool isBackground = false;
  double distance = 0;
  uint32_t content = 0, part = 0, patch = 0;
  double column = 0, row = 0;  // in texels, 0 to T - 1
  double cosine = 0;           // of the angle between the ray and the triangle's normal, not negative
  double opacity = 0;

  // Hits are sorted by this: those of contents of tiles come first.
  auto order() const { return std::tie(isBackground, distance, content, part, patch); }
};

struct ReferenceMeshPixel {
  std::array<double, 3> colour = {0, 0, 0};  // premultiplied
  double opacity = 0, distance = 0;
  std::vector<ReferenceMeshHit> hits;  // all of them, in order
};

namespace reference_mesh {

inline Vec3d decodeVertex(const PatchSet& set, uint32_t patch, uint32_t corner) {
  Vec3d vertex;
  for (size_t axis = 0; axis < 3; ++axis) {
    const double number = set.vertices[(size_t{patch} * 4 + corner) * 3 + axis];
    vertex[static_cast<Eigen::Index>(axis)] = set.origin[axis] + set.step * number;
  }
  return vertex;
}

// Calls visit(patch, corners, isSecond) for each triangle of a part. `corners`: their three places.
template <class Visit>
void forEachTriangle(const PatchSet& set, const Visit& visit) {
  for (uint32_t patch = 0; patch < set.patches; ++patch) {
    for (const bool isSecond : {false, true}) {
      if (isSecond && patch >= set.pairs) continue;
      const std::array<uint32_t, 3> numbers =
          isSecond ? std::array<uint32_t, 3>{3, 2, 1} : std::array<uint32_t, 3>{0, 1, 2};
      std::array<Vec3d, 3> corners;
      for (size_t i = 0; i < 3; ++i) corners[i] = decodeVertex(set, patch, numbers[i]);
      visit(patch, corners, isSecond);
    }
  }
}

// The values of one channel of a texture, mixed at a place in a patch: 0 to 1. A block has `stride` bytes, of which the
// channel's begin at `offset`.
inline double mixChannel(const PatchSet& set, const std::vector<uint8_t>& blocks, size_t stride, size_t offset,
                         const ReferenceMeshHit& hit) {
  size_t across = 0;
  while (across * across < set.patches) ++across;
  const size_t edge = set.patchEdge, left = edge * (hit.patch % across), top = edge * (hit.patch / across);
  const size_t x = std::min(static_cast<size_t>(hit.column), edge - 2),
               y = std::min(static_cast<size_t>(hit.row), edge - 2);
  const double u = hit.column - static_cast<double>(x), v = hit.row - static_cast<double>(y);
  double sum = 0;
  for (const size_t dy : {0u, 1u}) {
    for (const size_t dx : {0u, 1u}) {
      const size_t column = left + x + dx, row = top + y + dy;
      Bc4Block block;
      std::copy_n(blocks.data() + stride * (column / 4 + across * edge / 4 * (row / 4)) + offset, 8, block.begin());
      sum += (dx == 1 ? u : 1 - u) * (dy == 1 ? v : 1 - v) * decodeBc4(block)[column % 4 + 4 * (row % 4)];
    }
  }
  return sum / 255;
}

// Adds the hits at distances from `near` to `far`, by the algorithm of Möller and Trumbore.
inline void addHits(const MeshContent& content, const SceneRay& ray, double near, double far,
                    std::vector<ReferenceMeshHit>& hits) {
  for (uint32_t part = 0; part < content.parts.size(); ++part) {
    const PatchSet& set = content.parts[part];
    forEachTriangle(set, [&](uint32_t patch, const std::array<Vec3d, 3>& corners, bool isSecond) {
      const Vec3d first = corners[1] - corners[0], second = corners[2] - corners[0];
      const Vec3d p = ray.direction.cross(second);
      const double determinant = first.dot(p);
      if (determinant == 0) return;
      const Vec3d s = ray.origin - corners[0], q = s.cross(first);
      const double u = s.dot(p) / determinant, v = ray.direction.dot(q) / determinant, t = second.dot(q) / determinant;
      if (u < 0 || v < 0 || u + v > 1 || t < near || t > far) return;
      ReferenceMeshHit hit;
      hit.distance = t;
      hit.part = part;
      hit.patch = patch;
      hit.column = (isSecond ? 1 - u : u) * (set.patchEdge - 1);
      hit.row = (isSecond ? 1 - v : v) * (set.patchEdge - 1);
      hit.cosine = std::abs(first.cross(second).normalized().dot(ray.direction));
      hit.opacity = mixChannel(set, set.opacityBlocks, 8, 0, hit);
      hits.push_back(hit);
    });
  }
}

inline std::array<double, kMeshHarmonics> computeHarmonics(const Vec3d& d) {
  const double x = d.x(), y = d.y(), z = d.z(), pi = std::acos(-1.0);
  const double a = std::sqrt(3 / (4 * pi)), b = std::sqrt(15 / (4 * pi));
  return {std::sqrt(1 / (4 * pi)),
          -a * y,
          a * z,
          -a * x,
          b * x * y,
          -b * y * z,
          std::sqrt(5 / (16 * pi)) * (3 * z * z - 1),
          -b * x * z,
          b / 2 * (x * x - y * y)};
}

inline std::array<double, 3> computeColour(const PatchSet& set, const ReferenceMeshHit& hit, const Vec3d& direction) {
  std::vector<double> values;
  for (size_t f = 0; f < kMeshFeatures; ++f) {
    const double low = set.ranges[f].low, high = set.ranges[f].high;
    values.push_back(low + (high - low) * mixChannel(set, set.featureBlocks[f / 2], 16, 8 * (f % 2), hit));
  }
  for (const double harmonic : computeHarmonics(direction)) values.push_back(harmonic);
  for (const DenseLayer& layer : set.decoder) {
    const bool isLast = &layer == &set.decoder.back();
    std::vector<double> outputs;
    for (size_t o = 0; o < layer.outputs; ++o) {
      double sum = layer.biases[o];
      for (size_t i = 0; i < layer.inputs; ++i) sum += double{layer.weights[o * layer.inputs + i]} * values[i];
      outputs.push_back(isLast ? sum : std::max(sum, 0.0));
    }
    values = std::move(outputs);
  }
  return {1 / (1 + std::exp(-values[0])), 1 / (1 + std::exp(-values[1])), 1 / (1 + std::exp(-values[2]))};
}

inline std::array<double, 3> computeSky(const MeshContent& content, const Vec3d& direction) {
  Eigen::Index a = 0;
  for (Eigen::Index axis = 1; axis < 3; ++axis)
    if (std::abs(direction[axis]) > std::abs(direction[a])) a = axis;
  const size_t edge = content.skyEdge, side = static_cast<size_t>(2 * a) + (direction[a] < 0 ? 1 : 0);
  const auto place = [&](Eigen::Index axis) {
    return (direction[axis % 3] / std::abs(direction[a]) + 1) / 2 * static_cast<double>(edge - 1);
  };
  const double column = place(a + 1), row = place(a + 2);
  std::array<double, 3> colour = {0, 0, 0};
  for (size_t y = 0; y < edge; ++y) {
    for (size_t x = 0; x < edge; ++x) {
      const double weight = std::max(0.0, 1 - std::abs(column - static_cast<double>(x))) *
                            std::max(0.0, 1 - std::abs(row - static_cast<double>(y)));
      for (size_t c = 0; c < 3; ++c) colour[c] += weight * content.sky[3 * ((side * edge + y) * edge + x) + c] / 255;
    }
  }
  return colour;
}

// Returns the distances at which the ray enters and leaves the box, or infinite ones, the first larger than the second,
// if it misses it.
inline std::array<double, 2> crossBox(const SceneRay& ray, const Vec3d& low, const Vec3d& high) {
  std::array<double, 2> range = {-INFINITY, INFINITY};
  for (int axis = 0; axis < 3; ++axis) {
    const double from = ray.origin[axis], along = ray.direction[axis];
    if (along == 0) {
      if (from < low[axis] || from >= high[axis]) return {INFINITY, -INFINITY};
      continue;
    }
    const double a = (low[axis] - from) / along, b = (high[axis] - from) / along;
    range = {std::max(range[0], std::min(a, b)), std::min(range[1], std::max(a, b))};
  }
  return range;
}

// Returns the distance at which hits on the background block begin.
inline double backgroundBegin(const ReferenceMeshView& view, const SceneRay& ray) {
  const std::array<double, 2> box = crossBox(ray, view.low, view.high);
  return std::max(box[0], view.near) < box[1] ? box[1] : view.near;
}

}  // namespace reference_mesh

inline ReferenceMeshPixel traceReferenceMesh(const ReferenceMeshView& view, const SceneRay& ray) {
  using namespace reference_mesh;
  const double far = std::min(TileFrame::kSceneEnd, view.model);
  ReferenceMeshPixel pixel;
  for (uint32_t number = 0; number < view.blocks.size(); ++number) {
    const ReferenceMeshBlock& block = view.blocks[number];
    std::vector<ReferenceMeshHit> hits;
    addHits(*block.content, ray, view.near, far, hits);
    for (ReferenceMeshHit& hit : hits) {
      hit.content = number;
      const Vec3d at = ray.origin + hit.distance * ray.direction;
      const bool isInside =
          at.x() >= block.low[0] && at.x() < block.high[0] && at.y() >= block.low[1] && at.y() < block.high[1];
      if (isInside) pixel.hits.push_back(hit);
    }
  }
  if (view.background != nullptr) {
    const size_t first = pixel.hits.size();
    addHits(*view.background, ray, backgroundBegin(view, ray), far, pixel.hits);
    for (size_t i = first; i < pixel.hits.size(); ++i) pixel.hits[i].isBackground = true;
  }
  std::sort(pixel.hits.begin(), pixel.hits.end(),
            [](const ReferenceMeshHit& a, const ReferenceMeshHit& b) { return a.order() < b.order(); });
  double transmittance = 1;
  for (const ReferenceMeshHit& hit : pixel.hits) {
    if (hit.opacity <= 0) continue;
    const MeshContent& content = hit.isBackground ? *view.background : *view.blocks[hit.content].content;
    const std::array<double, 3> colour = computeColour(content.parts[hit.part], hit, ray.direction);
    const double weight = transmittance * hit.opacity;
    for (size_t c = 0; c < 3; ++c) pixel.colour[c] += weight * colour[c];
    pixel.distance += weight * hit.distance;
    transmittance *= 1 - hit.opacity;
  }
  pixel.opacity = 1 - transmittance;
  if (view.background != nullptr && view.background->skyEdge > 0 && view.model >= TileFrame::kSceneEnd) {
    const std::array<double, 3> sky = computeSky(*view.background, ray.direction);
    for (size_t c = 0; c < 3; ++c) pixel.colour[c] += transmittance * sky[c];
    if (pixel.opacity > 0) pixel.distance /= pixel.opacity;
    pixel.opacity = 1;
  }
  return pixel;
}

namespace reference_mesh {

constexpr double kUnsure = 1e-4, kFlattest = 0.02;

inline bool isClose(double a, double b) {
  return std::abs(a - b) < kUnsure * (1 + std::min(std::abs(a), std::abs(b)));
}

// Returns whether the ray passes closely by the edge from `a` to `b`.
inline bool passesEdge(const SceneRay& ray, const Vec3d& a, const Vec3d& b) {
  const Vec3d edge = b - a, from = ray.origin - a;
  const double along = ray.direction.dot(edge), start = ray.direction.dot(from), square = edge.squaredNorm(),
               crossed = square - along * along;
  // The nearest point of the edge to the line, and then to the ray.
  double s = crossed > 0 ? std::clamp((edge.dot(from) - along * start) / crossed, 0.0, 1.0) : 0;
  const double t = std::max(0.0, along * s - start);
  s = square > 0 ? std::clamp((edge.dot(from) + along * t) / square, 0.0, 1.0) : 0;
  return (from + t * ray.direction - s * edge).norm() < kUnsure * (1 + t);
}

// `begin`, `end`: where hits begin and end to count.
inline bool isUnsureOnContent(const MeshContent& content, const SceneRay& ray, double begin, double end,
                              const ReferenceMeshBlock& cells = {}) {
  bool isUnsure = false;
  for (const PatchSet& part : content.parts)
    forEachTriangle(part, [&](uint32_t, const std::array<Vec3d, 3>& corners, bool) {
      for (size_t i = 0; i < 3; ++i) isUnsure = isUnsure || passesEdge(ray, corners[i], corners[(i + 1) % 3]);
    });
  std::vector<ReferenceMeshHit> hits;
  addHits(content, ray, 0, INFINITY, hits);
  for (const ReferenceMeshHit& hit : hits) {
    isUnsure = isUnsure || hit.cosine < kFlattest || isClose(hit.distance, begin) || isClose(hit.distance, end);
    for (const Eigen::Index axis : {0, 1}) {
      const double at = ray.origin[axis] + hit.distance * ray.direction[axis];
      for (const double side : {cells.low[static_cast<size_t>(axis)], cells.high[static_cast<size_t>(axis)]})
        isUnsure = isUnsure || isClose(at, side);
    }
  }
  return isUnsure;
}

}  // namespace reference_mesh

// Returns whether a renderer that computes in single precision may decide otherwise than this reference: the ray passes
// closely by an edge of a triangle, of the scene's box, or of the sky; it meets a triangle at a flat angle, two
// surfaces that nearly coincide, or one close to where hits begin or end. Hits of one content at exactly equal
// distances are no such case.
inline bool isReferenceMeshUnsure(const ReferenceMeshView& view, const SceneRay& ray) {
  using namespace reference_mesh;
  const std::vector<ReferenceMeshHit> hits = traceReferenceMesh(view, ray).hits;
  for (size_t i = 1; i < hits.size(); ++i) {
    if (hits[i].isBackground != hits[i - 1].isBackground) continue;
    const bool isTie = hits[i].distance == hits[i - 1].distance && hits[i].content == hits[i - 1].content;
    if (!isTie && isClose(hits[i].distance, hits[i - 1].distance)) return true;
  }
  for (const ReferenceMeshBlock& block : view.blocks)
    if (isUnsureOnContent(*block.content, ray, view.near, view.model, block)) return true;
  if (view.background == nullptr) return false;
  std::array<double, 3> sizes = {std::abs(ray.direction.x()), std::abs(ray.direction.y()), std::abs(ray.direction.z())};
  std::sort(sizes.begin(), sizes.end());
  const std::array<double, 2> box = crossBox(ray, view.low, view.high);
  return isClose(sizes[1], sizes[2]) || isClose(std::max(box[0], view.near), box[1]) ||
         isUnsureOnContent(*view.background, ray, backgroundBegin(view, ray), view.model);
}

}  // namespace tessera

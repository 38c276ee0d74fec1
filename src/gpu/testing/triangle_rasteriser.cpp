#include "gpu/testing/triangle_rasteriser.h"

#include <cmath>
#include <limits>

#include "base/random.h"

namespace tessera::gpu_test {
namespace {

constexpr double kEdgeMargin = 1.0 / 64;  // pixels; implementations round vertices to 1/256 or finer
constexpr double kDepthMargin = 1e-4;

struct Corner {
  double x, y, depth, inverseW;
};

double area(const Corner& a, const Corner& b, double x, double y) {
  return (b.x - a.x) * (y - a.y) - (b.y - a.y) * (x - a.x);
}

// Vulkan 1.2, sections 24 (coordinate transformations) and 27.7 (polygons): attributes are perspective-correct, depth
// is linear in screen space.
class Rasteriser {
 public:
  Rasteriser(const Triangles& triangles, ImageSize size, Faces faces)
      : triangles_(triangles), size_(size), faces_(faces), pixels_(size_t{size.width} * size.height) {
    secondDepths_.resize(pixels_.size(), std::numeric_limits<double>::infinity());
  }

  std::vector<RasterisedPixel> run() {
    for (uint32_t t = 0; t < triangles_.indices.size() / 3; ++t) draw(t);
    for (size_t p = 0; p < pixels_.size(); ++p) {
      if (secondDepths_[p] - pixels_[p].depth < kDepthMargin) pixels_[p].isCertain = false;
    }
    return std::move(pixels_);
  }

 private:
  const Vertex& vertex(uint32_t triangle, size_t corner) const {
    return triangles_.vertices[triangles_.indices[3 * triangle + corner]];
  }

  void draw(uint32_t t) {
    std::array<Corner, 3> corners;
    for (size_t i = 0; i < 3; ++i) {
      const auto& clip = vertex(t, i).position;
      const double w = clip[3];
      corners[i] = {(clip[0] / w + 1) / 2 * size_.width, (clip[1] / w + 1) / 2 * size_.height, clip[2] / w, 1 / w};
    }
    // With y downwards, a positive area is clockwise.
    const double whole = area(corners[0], corners[1], corners[2].x, corners[2].y);
    if (faces_ == Faces::clockwise && whole < 0) return;
    if (faces_ == Faces::counterClockwise && whole > 0) return;
    for (uint32_t y = 0; y < size_.height; ++y) {
      for (uint32_t x = 0; x < size_.width; ++x) drawPixel(t, corners, whole, x, y);
    }
  }

  void drawPixel(uint32_t t, const std::array<Corner, 3>& corners, double whole, uint32_t x, uint32_t y) {
    std::array<double, 3> weights;
    bool isInside = true, isClose = false;
    for (size_t i = 0; i < 3; ++i) {
      const Corner &a = corners[(i + 1) % 3], &b = corners[(i + 2) % 3];
      const double part = area(a, b, x + 0.5, y + 0.5);
      weights[i] = part / whole;
      isInside = isInside && weights[i] >= 0;
      isClose = isClose || std::abs(part) < kEdgeMargin * std::hypot(b.x - a.x, b.y - a.y);
    }
    RasterisedPixel& pixel = pixels_[size_t{y} * size_.width + x];
    if (isClose) pixel.isCertain = false;
    if (!isInside) return;
    ++pixel.covered;
    pixel.largest = t + 1;
    double depth = 0, inverseW = 0;
    for (size_t i = 0; i < 3; ++i) {
      depth += weights[i] * corners[i].depth;
      inverseW += weights[i] * corners[i].inverseW;
    }
    double& second = secondDepths_[size_t{y} * size_.width + x];
    if (depth >= pixel.depth) {
      second = std::min(second, depth);
      return;
    }
    if (pixel.number != 0) second = pixel.depth;
    pixel.depth = depth;
    pixel.number = t + 1;
    for (size_t c = 0; c < 4; ++c) {
      pixel.colour[c] = 0;
      for (size_t i = 0; i < 3; ++i) {
        pixel.colour[c] += weights[i] * corners[i].inverseW / inverseW * vertex(t, i).colour[c];
      }
    }
  }

  const Triangles& triangles_;
  ImageSize size_;
  Faces faces_;
  std::vector<RasterisedPixel> pixels_;
  std::vector<double> secondDepths_;  // of the second-nearest triangle
};

}  // namespace

Triangles randomTriangles(uint64_t seed, size_t count) {
  const RandomStream random(seed, 0);
  uint64_t index = 0;
  const auto between = [&](float low, float high) { return low + (high - low) * random.uniform(index++); };
  Triangles triangles;
  for (size_t t = 0; t < count; ++t) {
    const float x = between(-0.6f, 0.6f), y = between(-0.6f, 0.6f);
    for (uint32_t corner = 0; corner < 3; ++corner) {
      Vertex& vertex = triangles.vertices.emplace_back();
      const float w = between(0.5f, 3);
      vertex.position = {w * (x + between(-1.5f, 1.5f)), w * (y + between(-1.5f, 1.5f)), w * between(0.1f, 0.9f), w};
      for (float& value : vertex.colour) value = between(0, 1);
    }
  }
  // Indices have a different order than vertices, so that they matter.
  for (size_t i = triangles.vertices.size(); i-- > 0;) triangles.indices.push_back(static_cast<uint32_t>(i));
  return triangles;
}

std::vector<RasterisedPixel> rasterise(const Triangles& triangles, ImageSize size, Faces faces) {
  return Rasteriser(triangles, size, faces).run();
}

}  // namespace tessera::gpu_test

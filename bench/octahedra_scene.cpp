#include "bench/octahedra_scene.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>

#include "base/random.h"
#include "train/image_rays.h"

namespace tessera {
namespace {

constexpr uint32_t kGroup = 8;  // pixels along the edge of a group

// A ray in grid coordinates: at + t · along.
struct GridRay {
  double at[3], along[3];

  GridRay(const OctahedraGrid& grid, const float* origin, const float* direction) {
    for (size_t row = 0; row < 3; ++row) {
      const float* const m = grid.gridFromScene.data() + 4 * row;
      at[row] = m[3];
      along[row] = 0;
      for (int column = 0; column < 3; ++column) {
        at[row] += double{m[column]} * origin[column];
        along[row] += double{m[column]} * direction[column];
      }
    }
  }
  bool crosses(const OctahedraGrid& grid) const {
    double enter = 0, leave = std::numeric_limits<double>::infinity();
    for (int axis = 0; axis < 3; ++axis) {
      const double low = -at[axis] / along[axis], high = (grid.resolution - at[axis]) / along[axis];
      enter = std::max(enter, std::min(low, high));
      leave = std::min(leave, std::max(low, high));
    }
    return enter < leave;
  }
};

}  // namespace

void RaySet::add(const OctahedraGrid& grid, const float* origin, const float* direction) {
  const GridRay ray(grid, origin, direction);
  for (int axis = 0; axis < 3; ++axis) {
    gridOrigins.push_back(static_cast<float>(ray.at[axis]));
    gridDirections.push_back(static_cast<float>(ray.along[axis]));
  }
  origins.insert(origins.end(), origin, origin + 3);
  directions.insert(directions.end(), direction, direction + 3);
}

RaySet shuffle(const RaySet& rays, const OctahedraGrid& grid) {
  const RandomStream random(1, 2);
  std::vector<uint32_t> order(rays.count());
  std::iota(order.begin(), order.end(), 0u);
  for (uint32_t i = rays.count(); i > 1; --i) std::swap(order[i - 1], order[random.below(i, i)]);
  RaySet shuffled{"random order"};
  for (const size_t ray : order) shuffled.add(grid, &rays.origins[3 * ray], &rays.directions[3 * ray]);
  return shuffled;
}

TracedGrid makeSyntheticGrid(double share) {
  TracedGrid traced{"synthetic", OctahedraGrid{64}};
  OctahedraGrid& grid = traced.grid;
  grid.gridFromScene = {32, 0, 0, 32, 0, 32, 0, 32, 0, 0, 32, 32, 0, 0, 0, 1};
  const RandomStream random(1, 0);
  for (size_t i = 0; i < size_t{3} * grid.cells(); ++i)
    traced.displacements.push_back(static_cast<float>(share) * kMaxDisplacement * (2 * random.uniform(i) - 1));
  traced.tracedCells.resize(grid.words());
  const int n = static_cast<int>(grid.resolution);
  for (int j = 0; j < n; ++j) {
    for (int i = 0; i < n; ++i) {
      const double height =
          32 + 3 * std::sin(2 * std::numbers::pi * i / 32) + 3 * std::cos(2 * std::numbers::pi * j / 40);
      for (int layer = -1; layer <= 1; ++layer) {
        const uint32_t cell = static_cast<uint32_t>(i + n * (j + n * (static_cast<int>(height) + layer)));
        traced.tracedCells[cell / 32] |= 1u << cell % 32;
      }
    }
  }
  return traced;
}

RaySet makeSyntheticRays(const OctahedraGrid& grid) {
  constexpr uint32_t kGroups = 4096;
  constexpr double kHeight = 2, kPixel = 0.1 / 64;
  RaySet rays{"8x8 pixels"};
  const RandomStream random(1, 1);
  for (uint64_t group = 0; group < kGroups; ++group) {
    const auto draw = [&](uint64_t number) { return random.uniformDouble(8 * group + number); };
    const double cosine = 1 - draw(0) * (1 - std::cos(35 * std::numbers::pi / 180));
    const double sine = std::sqrt(1 - cosine * cosine), azimuth = 2 * std::numbers::pi * draw(1);
    const Vec3d forward = {sine * std::cos(azimuth), sine * std::sin(azimuth), -cosine};
    const double turn = 2 * std::numbers::pi * draw(2);
    const Vec3d right = forward.cross(Vec3d(std::cos(turn), std::sin(turn), 0)).normalized(),
                down = forward.cross(right);
    const Vec3d origin = Vec3d(2 * draw(3) - 1, 2 * draw(4) - 1, 0) - forward * (kHeight / cosine);
    for (uint32_t y = 0; y < kGroup; ++y) {
      for (uint32_t x = 0; x < kGroup; ++x) {
        const Vec3d along = (forward + kPixel * ((x - 3.5) * right + (y - 3.5) * down)).normalized();
        const Vec3f from = origin.cast<float>(), direction = along.cast<float>();
        rays.add(grid, from.data(), direction.data());
      }
    }
  }
  return rays;
}

RaySet makePhotoRays(Device& device, const Capture& capture, std::span<const int> photos, const SceneFrame& frame,
                     const OctahedraGrid& grid) {
  RaySet rays{"8x8 pixels"};
  ImageRays imageRays(device, kBatch);
  for (const int number : photos) {
    const Photo& photo = capture.photos[static_cast<size_t>(number)];
    const Camera& camera = capture.cameras[static_cast<size_t>(photo.camera)];
    imageRays.begin(makeRayCamera(camera, photo.worldFromCamera, frame), frame, {});
    std::vector<float> pixels;
    const auto flush = [&] {
      const ImageRays::Piece piece = imageRays.through(pixels);
      const auto [origins, directions] =
          device.readAll(Slice<const float>(piece.origins.part(0, size_t{3} * piece.rays)),
                         Slice<const float>(piece.directions.part(0, size_t{3} * piece.rays)));
      for (size_t ray = 0; ray < piece.rays; ++ray)
        if (GridRay(grid, &origins[3 * ray], &directions[3 * ray]).crosses(grid))
          rays.add(grid, &origins[3 * ray], &directions[3 * ray]);
      pixels.clear();
    };
    const int group = static_cast<int>(kGroup);
    for (int top = 0; top < camera.height; top += group) {
      for (int left = 0; left < camera.width; left += group) {
        for (int y = top; y < std::min(top + group, camera.height); ++y) {
          for (int x = left; x < std::min(left + group, camera.width); ++x) {
            pixels.push_back(static_cast<float>(x) + 0.5f);
            pixels.push_back(static_cast<float>(y) + 0.5f);
          }
        }
        if (pixels.size() + 2 * kGroup * kGroup > 2 * kBatch) flush();
      }
    }
    if (!pixels.empty()) flush();
  }
  return rays;
}

std::vector<float> placeVertices(const OctahedraGrid& grid, const std::vector<uint32_t>& cells,
                                 const std::vector<float>& displacements) {
  std::vector<float> vertices;
  const uint32_t n = grid.resolution;
  for (const size_t cell : cells) {
    const size_t place[3] = {cell % n, cell / n % n, cell / (n * n)};
    for (size_t axis = 0; axis < 3; ++axis)
      vertices.push_back(static_cast<float>(place[axis]) + 0.5f + displacements[3 * cell + axis]);
  }
  return vertices;
}

FaceTriangles listTriangles(const TracedGrid& traced) {
  const OctahedraGrid& grid = traced.grid;
  const int n = static_cast<int>(grid.resolution);
  const std::vector<ReachingFace> reaching[2] = {reachingFaces(grid.placement, 0), reachingFaces(grid.placement, 1)};
  std::vector<bool> isListed(size_t{kFacesPerCell} * grid.cells());
  for (uint32_t cell = 0; cell < grid.cells(); ++cell) {
    if ((traced.tracedCells[cell / 32] >> cell % 32 & 1) == 0) continue;
    const int place[3] = {static_cast<int>(cell) % n, static_cast<int>(cell) / n % n, static_cast<int>(cell) / (n * n)};
    for (const ReachingFace& face : reaching[(place[0] + place[1] + place[2]) % 2]) {
      bool exists = true;
      for (const std::array<int, 3>& corner : octahedronFace(face.local)) {
        for (size_t axis = 0; axis < 3; ++axis) {
          const int at = place[axis] + face.octahedron[axis] + corner[axis];
          exists = exists && at >= 0 && at < n;
        }
      }
      if (!exists) continue;
      const int octahedron =
          static_cast<int>(cell) + face.octahedron[0] + n * (face.octahedron[1] + n * face.octahedron[2]);
      isListed[size_t{kFacesPerCell} * static_cast<size_t>(octahedron) + face.local] = true;
    }
  }
  FaceTriangles all;
  std::vector<uint32_t> cornerCells;
  std::vector<uint32_t> vertexNumbers(grid.cells(), 0);
  for (uint32_t face = 0; face < isListed.size(); ++face) {
    if (!isListed[face]) continue;
    all.faces.push_back(face);
    for (const std::array<int, 3>& corner : octahedronFace(face % kFacesPerCell)) {
      const int cell = static_cast<int>(face / kFacesPerCell) + corner[0] + n * (corner[1] + n * corner[2]);
      cornerCells.push_back(static_cast<uint32_t>(cell));
      vertexNumbers[static_cast<size_t>(cell)] = 1;
    }
  }
  for (uint32_t cell = 0; cell < grid.cells(); ++cell) {
    if (vertexNumbers[cell] == 0) continue;
    vertexNumbers[cell] = static_cast<uint32_t>(all.vertexCells.size());
    all.vertexCells.push_back(cell);
  }
  for (const uint32_t cell : cornerCells) all.triangles.corners.push_back(vertexNumbers[cell]);
  all.triangles.vertices = placeVertices(grid, all.vertexCells, traced.displacements);
  return all;
}

}  // namespace tessera

#include "compute/octahedra.h"

#include <algorithm>
#include <cmath>

#include "compute/composite.h"
#include "compute/reference/convert.h"
#include "compute/reference/functions.h"

namespace tessera::reference {
namespace {

double dot3(const Point& a, const Point& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

Point cross3(const Point& a, const Point& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

Point minus(const Point& a, const Point& b) {
  return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}

// A ray in homogeneous grid coordinates: start + t · slope.
struct GridRay {
  std::array<double, 4> start{}, slope{};

  GridRay(const OctahedraGrid& grid, const Point& origin, const Point& direction) {
    for (int row = 0; row < 4; ++row) {
      const float* const m = grid.gridFromScene.data() + 4 * row;
      start[row] = m[3];
      for (int column = 0; column < 3; ++column) {
        start[row] += m[column] * origin[column];
        slope[row] += m[column] * direction[column];
      }
    }
  }
  double scaleAt(double t) const { return start[3] + t * slope[3]; }
  Point at(double t) const {
    const double w = scaleAt(t);
    return {(start[0] + t * slope[0]) / w, (start[1] + t * slope[1]) / w, (start[2] + t * slope[2]) / w};
  }
  Point slopeAt(double t) const {
    const Point g = at(t);
    const double w = scaleAt(t);
    return {(slope[0] - g[0] * slope[3]) / w, (slope[1] - g[1] * slope[3]) / w, (slope[2] - g[2] * slope[3]) / w};
  }
};

bool isBefore(const FaceHit& a, const FaceHit& b) {
  return a.distance != b.distance ? a.distance < b.distance : a.face < b.face;
}

std::array<uint32_t, 3> cellOfFace(const OctahedraGrid& grid, uint32_t face) {
  const uint32_t cell = face / kFacesPerCell, n = grid.resolution;
  return {cell % n, cell / n % n, cell / (n * n)};
}

}  // namespace

std::optional<std::array<uint32_t, 3>> verticesOfFace(const OctahedraGrid& grid, uint32_t face) {
  const std::array<uint32_t, 3> cell = cellOfFace(grid, face);
  if (!carriesOctahedron(grid.placement, cell[0], cell[1], cell[2])) return std::nullopt;
  const auto corners = octahedronFace(face % kFacesPerCell);
  std::array<uint32_t, 3> vertices{};
  for (int corner = 0; corner < 3; ++corner) {
    uint32_t stride = 1;
    for (int axis = 0; axis < 3; ++axis) {
      const uint32_t at = cell[axis] + static_cast<uint32_t>(corners[corner][axis]);  // -1 wraps beyond the grid
      if (at >= grid.resolution) return std::nullopt;
      vertices[corner] += stride * at;
      stride *= grid.resolution;
    }
  }
  return vertices;
}

Point gridVertex(const OctahedraGrid& grid, View displacements, uint32_t vertex) {
  const uint32_t n = grid.resolution;
  return {vertex % n + 0.5 + displacements[3 * vertex], vertex / n % n + 0.5 + displacements[3 * vertex + 1],
          vertex / (n * n) + 0.5 + displacements[3 * vertex + 2]};
}

std::optional<FaceHit> hitPlaneOfFace(const OctahedraGrid& grid, View displacements, const Point& origin,
                                      const Point& direction, uint32_t face) {
  const auto vertices = verticesOfFace(grid, face);
  if (!vertices) return std::nullopt;
  Point v[3];
  for (int corner = 0; corner < 3; ++corner) v[corner] = gridVertex(grid, displacements, (*vertices)[corner]);
  // The plane n · (x - v0) = 0 in homogeneous coordinates, at which the ray has one parameter t.
  const Point normal = cross3(minus(v[1], v[0]), minus(v[2], v[0]));
  const GridRay ray(grid, origin, direction);
  const double offset = dot3(normal, v[0]);
  const double across = dot3(normal, {ray.slope[0], ray.slope[1], ray.slope[2]}) - offset * ray.slope[3];
  if (across == 0) return std::nullopt;
  FaceHit hit;
  hit.face = face;
  hit.distance = (offset * ray.start[3] - dot3(normal, {ray.start[0], ray.start[1], ray.start[2]})) / across;
  if (ray.scaleAt(hit.distance) <= 0) return std::nullopt;
  hit.position = ray.at(hit.distance);
  const double area = dot3(normal, normal);
  for (int corner = 0; corner < 3; ++corner) {
    const Point &a = v[(corner + 1) % 3], &b = v[(corner + 2) % 3];
    hit.barycentrics[corner] = dot3(normal, cross3(minus(a, hit.position), minus(b, hit.position))) / area;
  }
  return hit;
}

double distanceBehindBox(const std::array<float, 3>& halfEdges, const Point& origin, const Point& direction) {
  if (halfEdges == std::array<float, 3>{}) return 0;
  double enter = 0, leave = std::numeric_limits<double>::infinity();
  for (int axis = 0; axis < 3; ++axis) {
    if (direction[axis] == 0) {
      if (std::abs(origin[axis]) > halfEdges[axis]) return 0;
      continue;
    }
    const double side = std::copysign(double{halfEdges[axis]}, direction[axis]);
    enter = std::max(enter, (-side - origin[axis]) / direction[axis]);
    leave = std::min(leave, (side - origin[axis]) / direction[axis]);
  }
  return enter < leave ? leave : 0;
}

std::vector<FaceHit> traceOctahedra(const OctahedraGrid& grid, View displacements, Indices occupancy,
                                    const Point& origin, const Point& direction, double near, double far) {
  std::vector<FaceHit> hits;
  if (direction == Point{}) return hits;
  const GridRay ray(grid, origin, direction);
  // A vertex of a face is at most (1.5, 0.5, 0.5) from the centre of the octahedron's cell.
  constexpr double kReach = 1.7;
  const Point line = {ray.slope[0] * ray.start[3] - ray.start[0] * ray.slope[3],
                      ray.slope[1] * ray.start[3] - ray.start[1] * ray.slope[3],
                      ray.slope[2] * ray.start[3] - ray.start[2] * ray.slope[3]};  // parallel to the ray in the grid
  // A point of the ray in grid coordinates. The scale is not zero there, as the ray would lie at infinity otherwise.
  const Point through = std::abs(ray.scaleAt(0)) >= std::abs(ray.scaleAt(1)) ? ray.at(0) : ray.at(1);
  const double square = dot3(line, line);
  if (square == 0) return hits;
  const uint32_t n = grid.resolution;
  for (uint32_t cell = 0; cell < grid.cells(); ++cell) {
    const Point centre = {cell % n + 0.5, cell / n % n + 0.5, cell / (n * n) + 0.5};
    const Point aside = cross3(line, minus(centre, through));
    if (dot3(aside, aside) > kReach * kReach * square) continue;
    for (uint32_t local = 0; local < kFacesPerCell; ++local) {
      const auto hit = hitPlaneOfFace(grid, displacements, origin, direction, cell * kFacesPerCell + local);
      if (!hit || !(hit->distance > near && hit->distance < far)) continue;
      if (*std::min_element(hit->barycentrics.begin(), hit->barycentrics.end()) < 0) continue;
      uint32_t place = 0, stride = 1;
      bool inside = true;
      for (int axis = 0; axis < 3; ++axis) {
        const double g = hit->position[axis];
        inside = inside && g >= std::max(0.0f, grid.lowest[axis]) && g < std::min<double>(n, grid.highest[axis]);
        place += stride * static_cast<uint32_t>(hit->position[axis]);
        stride *= n;
      }
      if (inside && (occupancy[place / 32] >> place % 32 & 1)) hits.push_back(*hit);
    }
  }
  std::sort(hits.begin(), hits.end(), isBefore);
  return hits;
}

Doubles octahedraBackward(const OctahedraGrid& grid, View displacements, double minCosine, const Point& origin,
                          const Point& direction, const FaceHit& hit, const Point& positionGradient,
                          double distanceGradient) {
  Doubles gradients(9);
  const auto vertices = verticesOfFace(grid, hit.face);
  CHECK(vertices.has_value());
  Point v[3];
  for (int corner = 0; corner < 3; ++corner) v[corner] = gridVertex(grid, displacements, (*vertices)[corner]);
  const Point normal = cross3(minus(v[1], v[0]), minus(v[2], v[0]));
  const Point slope = GridRay(grid, origin, direction).slopeAt(hit.distance);
  const double lengths = std::sqrt(dot3(normal, normal) * dot3(slope, slope));
  double across = dot3(normal, slope);
  across = std::copysign(std::max(std::abs(across), minCosine * lengths), across);
  if (across == 0) return gradients;
  const double along = (distanceGradient + dot3(slope, positionGradient) * grid.positionScale()) / across;
  for (int corner = 0; corner < 3; ++corner)
    for (int axis = 0; axis < 3; ++axis) gradients[3 * corner + axis] = along * hit.barycentrics[corner] * normal[axis];
  return gradients;
}

void run(const TraceOctahedra& a) {
  const size_t rays = hostCount(a.rays);
  const Doubles origins = doubles(a.origins, 3 * rays), directions = doubles(a.directions, 3 * rays);
  const Doubles farOfRay = doubles(a.farOfRay, rays);
  const OctahedraGrid& first = a.grids.front();
  const size_t cells = first.cells();
  const Doubles displacements = doubles(a.displacements, 3 * cells * a.grids.size());
  const Indices occupancy = indices(a.occupancy, first.words() * a.grids.size());
  Doubles barycentrics, positions, distances;
  uint32_t sampleCount = 0, finished = 0;
  bool full = false;
  hostPointer(a.firstSample)[0] = 0;
  for (size_t r = 0; r < rays; ++r) {
    const Point origin = {origins[3 * r], origins[3 * r + 1], origins[3 * r + 2]};
    const Point direction = {directions[3 * r], directions[3 * r + 1], directions[3 * r + 2]};
    const double near = std::max<double>(a.near, distanceBehindBox(a.boxInFront, origin, direction));
    std::vector<FaceHit> hits;
    for (size_t g = 0; g < a.grids.size(); ++g) {
      for (FaceHit hit : traceOctahedra(a.grids[g], View(displacements).subspan(3 * cells * g, 3 * cells),
                                        occupancy.subspan(first.words() * g, first.words()), origin, direction, near,
                                        farOfRay.empty() ? 1e30 : farOfRay[r])) {
        hit.face += static_cast<uint32_t>(kFacesPerCell * cells * g);
        for (int axis = 0; axis < 3; ++axis)
          hit.position[axis] = (hit.position[axis] + a.grids[g].positionOffset[axis]) * a.grids[g].positionScale();
        hits.push_back(hit);
      }
    }
    std::sort(hits.begin(), hits.end(), isBefore);
    if (a.keptFaces) {
      const Indices faceBits = indices(a.keptFaces, faceWords(a.grids));
      std::erase_if(hits, [&](const FaceHit& hit) { return (faceBits[hit.face / 32] >> hit.face % 32 & 1) == 0; });
    }
    if (hits.size() > a.maximum) hits.resize(a.maximum);
    full = full || sampleCount + hits.size() > a.sampleCapacity;
    if (!full) {
      ++finished;
      for (const FaceHit& hit : hits) {
        if (a.rayOfSample) hostPointer(a.rayOfSample)[sampleCount] = static_cast<uint32_t>(r);
        hostPointer(a.faces)[sampleCount++] = hit.face;
        barycentrics.insert(barycentrics.end(), hit.barycentrics.begin() + 1, hit.barycentrics.end());
        positions.insert(positions.end(), hit.position.begin(), hit.position.end());
        distances.push_back(hit.distance);
      }
    }
    hostPointer(a.firstSample)[r + 1] = sampleCount;
  }
  hostPointer(a.sampleCount)[0] = sampleCount;
  if (a.finishedRays) hostPointer(a.finishedRays)[0] = finished;
  store(a.barycentrics, barycentrics);
  store(a.positions, positions);
  store(a.distances, distances);
}

void run(const OctahedraBackward& a) {
  const size_t samples = hostCount(a.samples), cells = a.grids.front().cells();
  const Doubles displacements = doubles(a.displacements, 3 * cells * a.grids.size());
  const Doubles barycentrics = doubles(a.barycentrics, 2 * samples), distances = doubles(a.distances, samples);
  const Doubles positionGradients = doubles(a.positionGradients, 3 * samples);
  const Doubles distanceGradients = doubles(a.distanceGradients, samples);
  const Indices rayOfSample = indices(a.rayOfSample, samples), faces = indices(a.faces, samples);
  const auto pointAt = [](const auto& values, size_t i) {
    return Point{values[3 * i], values[3 * i + 1], values[3 * i + 2]};
  };
  Doubles sums(displacements.size());
  for (size_t s = 0; s < samples; ++s) {
    FaceHit hit;
    const size_t g = faces[s] / (kFacesPerCell * cells);
    const OctahedraGrid& grid = a.grids[g];
    hit.face = static_cast<uint32_t>(faces[s] - kFacesPerCell * cells * g);
    hit.distance = distances[s];
    hit.barycentrics = {1 - barycentrics[2 * s] - barycentrics[2 * s + 1], barycentrics[2 * s],
                        barycentrics[2 * s + 1]};
    const Doubles gradients = octahedraBackward(
        grid, View(displacements).subspan(3 * cells * g, 3 * cells), a.minCosine,
        pointAt(hostPointer(a.origins), rayOfSample[s]), pointAt(hostPointer(a.directions), rayOfSample[s]), hit,
        pointAt(positionGradients, s), distanceGradients.empty() ? 0 : distanceGradients[s]);
    const auto vertices = verticesOfFace(grid, hit.face);
    for (int corner = 0; corner < 3; ++corner)
      for (int axis = 0; axis < 3; ++axis)
        sums[3 * (cells * g + (*vertices)[corner]) + axis] += gradients[3 * corner + axis];
  }
  add(a.displacementGradients, sums);
}

void run(const MergeOctahedra& a) {
  const uint32_t n = a.resolution, coarse = n / 2;
  CHECK(n % 2 == 0u);
  const size_t listed = a.cells.count;
  const Indices cells = indices(a.cells, listed);
  const Doubles x = doubles(a.x, a.points * listed);
  Doubles opacities(size_t{n} * n * n);
  for (size_t i = 0; i < listed; ++i)
    for (size_t p = 0; p < a.points; ++p)
      opacities[cells[i]] += computeOpacity(Extinction::logit, x[p * listed + i] + a.offset, 0) / a.points;
  store(a.opacities, opacities);
  const Doubles displacements = doubles(a.displacements, 3 * opacities.size());
  Doubles merged;
  for (uint32_t cell = 0; cell < coarse * coarse * coarse; ++cell) {
    const uint32_t place[3] = {cell % coarse, cell / coarse % coarse, cell / (coarse * coarse)};
    double largest = MergeOctahedra::kTransparent;
    Point displacement{};
    for (uint32_t child = 0; child < 8; ++child) {
      const uint32_t side[3] = {child & 1, child >> 1 & 1, child >> 2};
      const uint32_t fine = 2 * place[0] + side[0] + n * (2 * place[1] + side[1] + n * (2 * place[2] + side[2]));
      // Opacities are compared as stored, so that all devices choose the same child of equal ones.
      const double opacity = static_cast<float>(opacities[fine]);
      if (!(opacity > largest)) continue;
      largest = opacity;
      for (int axis = 0; axis < 3; ++axis)
        displacement[axis] = (side[axis] - 0.5 + displacements[3 * size_t{fine} + axis]) / 2;
    }
    merged.insert(merged.end(), displacement.begin(), displacement.end());
  }
  store(a.mergedDisplacements, merged);
}

}  // namespace tessera::reference

// Test cases of octahedra grids. The reference tries every face, so these cases compare the walk through the cells with
// brute force.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "compute/device_test.h"
#include "compute/octahedra.h"

namespace tessera::device_test {
namespace {

constexpr double kMargin = 2e-4;    // in cells: see isClear
constexpr double kSteepest = 0.03;  // cosine between a ray and the normal of a face that it hits

struct NamedOctahedra {
  std::string name;
  std::vector<OctahedraGrid> grids;
  std::array<float, 3> boxInFront = {0, 0, 0};

  size_t vertices() const { return grids.size() * grids[0].cells(); }
  double firstDistance(const reference::Point& origin, const reference::Point& direction, double near) const {
    return std::max(near, reference::distanceBehindBox(boxInFront, origin, direction));
  }
};

std::vector<NamedOctahedra> octahedraGrids() {
  // The grid fills about [-1, 1]³ of the scene.
  const auto makeGrid = [](uint32_t resolution, OctahedraPlacement placement, bool projective) {
    OctahedraGrid grid{resolution, placement};
    const float half = 0.5f * static_cast<float>(resolution);
    grid.gridFromScene = {half, 0, 0, half, 0, half, 0, half, 0, 0, half, half, 0, 0, 0, 1};
    if (projective) {
      grid.gridFromScene = {half, 0.3f, 0,    half, 0,     1.1f * half, -0.2f,  half,
                            0.1f, 0,    half, half, 0.12f, 0.07f,       -0.15f, 1};
    }
    return grid;
  };
  std::vector<NamedOctahedra> all;
  for (const OctahedraPlacement placement : {OctahedraPlacement::checkerboard, OctahedraPlacement::all})
    for (const bool projective : {false, true})
      for (const uint32_t resolution : {4u, 6u})
        all.push_back(
            {fmt::format("{} cells, {}{}", resolution, placement == OctahedraPlacement::all ? "all" : "checkerboard",
                         projective ? ", projective" : ""),
             {makeGrid(resolution, placement, projective)}});
  OctahedraGrid box = makeGrid(6, OctahedraPlacement::checkerboard, false);
  box.lowest = {0.7f, 1, 1.3f};
  box.highest = {5.2f, 6, 4.6f};
  all.push_back({"6 cells, in a box", {box}});
  NamedOctahedra sides{"three sides of a box", {}, {0.4f, 0.3f, 0.5f}};
  for (const uint32_t side : {0u, 3u, 4u})
    sides.grids.push_back(makeOutsideGrid(side, 4, sides.boxInFront, OctahedraPlacement::checkerboard));
  all.push_back(sides);
  return all;
}

// Displacements up to the walls of the cells, or none.
std::vector<float> randomDisplacements(Random& random, size_t vertices, float share) {
  std::vector<float> displacements = random.floats(3 * vertices, -kMaxDisplacement * share, kMaxDisplacement * share);
  if (share == 1)
    for (float& d : displacements)
      if (random.below(10) == 0) d = random.below(2) ? kMaxDisplacement : -kMaxDisplacement;
  return displacements;
}

std::vector<uint32_t> randomOccupancy(Random& random, const NamedOctahedra& named, float share) {
  const size_t words = named.grids[0].words();
  std::vector<uint32_t> bits(words * named.grids.size());
  for (size_t grid = 0; grid < named.grids.size(); ++grid)
    for (uint32_t cell = 0; cell < named.grids[0].cells(); ++cell)
      if (random.uniform(0, 1) < share) bits[words * grid + cell / 32] |= 1u << cell % 32;
  return bits;
}

// Whether rounding cannot change the ray's hits: it passes the edges of all faces, the walls of all cells and boxes
// that it has hits in, and other hits at more than kMargin, hits no face at a flat angle, and no hit is at `near` or
// `far`.
bool isClear(const NamedOctahedra& named, View displacements, const reference::Point& origin,
             const reference::Point& direction, double near, double far) {
  Doubles distances;
  near = named.firstDistance(origin, direction, near);
  const size_t cells = named.grids[0].cells();
  for (size_t g = 0; g < named.grids.size(); ++g) {
    const OctahedraGrid& grid = named.grids[g];
    const View moved = displacements.subspan(3 * cells * g, 3 * cells);
    for (uint32_t face = 0; face < kFacesPerCell * cells; ++face) {
      const auto hit = reference::hitPlaneOfFace(grid, moved, origin, direction, face);
      if (!hit) continue;
      const double inside = *std::min_element(hit->barycentrics.begin(), hit->barycentrics.end());
      if (inside < -kMargin) continue;
      if (inside < kMargin || std::abs(hit->distance - near) < kMargin || std::abs(hit->distance - far) < kMargin)
        return false;
      for (int axis = 0; axis < 3; ++axis) {
        const double at = hit->position[axis];
        for (const double wall : {std::round(at), double{grid.lowest[axis]}, double{grid.highest[axis]}})
          if (std::abs(at - wall) < kMargin) return false;
      }
      // The face moves by the inverse of the cosine if it is moved along its normal.
      reference::FaceHit shifted = *hit;
      shifted.barycentrics = {1, 0, 0};
      const auto gradient = [&](double minCosine) {
        return reference::octahedraBackward(grid, moved, minCosine, origin, direction, shifted, {1, 1, 1}, 0);
      };
      if (gradient(kSteepest) != gradient(0)) return false;
      distances.push_back(hit->distance);
    }
  }
  std::sort(distances.begin(), distances.end());
  for (size_t i = 1; i < distances.size(); ++i)
    if (distances[i] - distances[i - 1] < kMargin * std::max(1.0, distances[i])) return false;
  return true;
}

struct OctahedraRays {
  std::vector<float> origins, directions, far;
};

// Rays that start inside and outside the grid, also along an axis, with directions of any length, and without
// direction.
OctahedraRays randomRays(Random& random, const NamedOctahedra& named, const std::vector<float>& displacements,
                         size_t count, float near, bool limited) {
  OctahedraRays rays;
  const Doubles moved = toDoubles(displacements);
  for (size_t r = 0; r < count; ++r) {
    for (;;) {
      std::vector<float> origin = random.floats(3, -0.95f, 0.95f), direction = random.directions(1);
      if (r % 2 == 1)
        for (int a = 0; a < 3; ++a) origin[a] -= 2.5f * direction[a];
      if (r % 5 == 3)
        for (size_t a = 0; a < 3; ++a) direction[a] = a == r / 5 % 3 ? (r % 2 ? 1.0f : -1.0f) : 0.0f;
      if (r % 11 == 7) direction = {0, 0, 0};
      for (float& d : direction) d *= r % 3 == 0 ? 0.7f : 1;
      const float far = limited ? random.uniform(0, 5) : 1e30f;
      const reference::Point o = {origin[0], origin[1], origin[2]}, d = {direction[0], direction[1], direction[2]};
      if (r % 11 != 7 && !isClear(named, moved, o, d, near, far)) continue;
      rays.origins.insert(rays.origins.end(), origin.begin(), origin.end());
      rays.directions.insert(rays.directions.end(), direction.begin(), direction.end());
      rays.far.push_back(far);
      break;
    }
  }
  return rays;
}

struct OctahedraOptions {
  float displaced = 1, occupied = 1, near = 0;
  bool everything = false;
  uint32_t maximum = 0xffffffffu, sampleCapacity = 4000;
};

void runTrace(Stage& stage, const NamedOctahedra& named, const Size& size, const OctahedraOptions& options) {
  const std::vector<float> displacements = randomDisplacements(stage.random, named.vertices(), options.displaced);
  const OctahedraRays rays =
      randomRays(stage.random, named, displacements, size.capacity, options.near, options.everything);
  TraceOctahedra a{named.grids};
  a.boxInFront = named.boxInFront;
  a.rays = stage.count(size);
  a.sampleCapacity = options.sampleCapacity;
  a.maximum = options.maximum;
  a.near = options.near;
  a.origins = stage.input(rays.origins);
  a.directions = stage.input(rays.directions);
  if (options.everything) a.farOfRay = stage.input(rays.far);
  a.displacements = stage.input(displacements);
  a.occupancy = stage.input(randomOccupancy(stage.random, named, options.occupied));
  if (options.everything) {
    std::vector<uint32_t> bits(faceWords(named.grids));
    for (uint32_t& word : bits) word = stage.random.bits() | stage.random.bits();
    a.keptFaces = stage.input(bits);
  }
  a.firstSample = stage.outputWords("firstSample", size.capacity + 1);
  a.sampleCount = stage.outputWords("sampleCount", 1);
  if (options.everything) {
    a.finishedRays = stage.outputWords("finishedRays", 1);
    a.rayOfSample = stage.outputWords("rayOfSample", options.sampleCapacity);
  }
  a.faces = stage.outputWords("faces", options.sampleCapacity);
  a.barycentrics = stage.output("barycentrics", 2 * options.sampleCapacity, 1e-4);
  a.positions = stage.output("positions", 3 * options.sampleCapacity, 1e-5);
  a.distances = stage.output("distances", options.sampleCapacity, 1e-5);
  stage.device.run(a);
}

// Hits of random rays, found by the reference.
struct OctahedraHits {
  OctahedraRays rays;
  std::vector<float> displacements, barycentrics, distances;
  std::vector<uint32_t> rayOfSample, faces;

  OctahedraHits(Random& random, const NamedOctahedra& named, size_t rayCount, size_t sampleCount)
      : displacements(randomDisplacements(random, named.vertices(), 1)) {
    rays = randomRays(random, named, displacements, rayCount, 0, false);
    const std::vector<uint32_t> everywhere(named.grids[0].words(), ~0u);
    const Doubles moved = toDoubles(displacements);
    const uint32_t cells = named.grids[0].cells();
    while (faces.size() < sampleCount) {
      const uint32_t ray = random.below(static_cast<uint32_t>(rayCount));
      const auto point = [&](const std::vector<float>& values) {
        return reference::Point{values[3 * ray], values[3 * ray + 1], values[3 * ray + 2]};
      };
      const uint32_t grid = random.below(static_cast<uint32_t>(named.grids.size()));
      const auto hits =
          reference::traceOctahedra(named.grids[grid], View(moved).subspan(size_t{3} * cells * grid, size_t{3} * cells),
                                    everywhere, point(rays.origins), point(rays.directions), 0, 1e30);
      if (hits.empty()) continue;
      const reference::FaceHit& hit = hits[random.below(static_cast<uint32_t>(hits.size()))];
      rayOfSample.push_back(ray);
      faces.push_back(kFacesPerCell * cells * grid + hit.face);
      barycentrics.push_back(static_cast<float>(hit.barycentrics[1]));
      barycentrics.push_back(static_cast<float>(hit.barycentrics[2]));
      distances.push_back(static_cast<float>(hit.distance));
    }
  }
  void setInputs(Stage& stage, const Size& size, OctahedraBackward& a) const {
    a.samples = stage.count(size);
    a.origins = stage.input(rays.origins);
    a.directions = stage.input(rays.directions);
    a.displacements = stage.input(displacements);
    a.rayOfSample = stage.input(rayOfSample);
    a.faces = stage.input(faces);
    a.barycentrics = stage.input(barycentrics);
    a.distances = stage.input(distances);
  }
};

}  // namespace

template <>
OperationTests makeTests<TraceOctahedra>() {
  OperationTests tests;
  tests.decides = true;
  tests.noGradient = "its gradient is OctahedraBackward";
  for (const NamedOctahedra& named : octahedraGrids()) {
    const auto add = [&](const std::string& name, const Size& size, const OctahedraOptions& options) {
      tests.cases.push_back({fmt::format("{}, {}, rays {}", named.name, name, toString(size)),
                             [=](Stage& stage) { runTrace(stage, named, size, options); }});
    };
    add("displaced", Size{25}, {});
    add("slightly displaced, half occupied", Size{25}, {.displaced = 0.2f, .occupied = 0.5f});
    add("few occupied", Size{30, 17}, {.occupied = 0.05f});
    add("none occupied", Size{5}, {.occupied = 0});
    add("near, far, few samples", Size{40, 1000}, {.near = 0.3f, .everything = true, .sampleCapacity = 120});
    add("at most three hits", Size{25}, {.everything = true, .maximum = 3});
    add("at most no hit", Size{5}, {.maximum = 0});
  }
  const NamedOctahedra named = octahedraGrids().front();
  for (const Size& size : {Size{0}, Size{1}, Size{5, 0}, Size{150}})
    tests.cases.push_back(
        {"rays " + toString(size), [=](Stage& stage) { runTrace(stage, named, size, {.occupied = 0.3f}); }});
  return tests;
}

template <>
OperationTests makeTests<OctahedraBackward>() {
  OperationTests tests;
  for (const NamedOctahedra& named : octahedraGrids())
    for (const Size& size : {Size{1}, Size{5, 0}, Size{64, 50}, Size{130, 1000}})
      for (const bool distances : {false, true})
        tests.cases.push_back(
            {fmt::format("{}, samples {}{}", named.name, toString(size), distances ? ", distance gradients" : ""),
             [=](Stage& stage) {
               const OctahedraHits hits(stage.random, named, 9, size.capacity);
               OctahedraBackward a{named.grids};
               hits.setInputs(stage, size, a);
               if (distances) a.minCosine = 0.6f;
               a.positionGradients = stage.randomInput(3 * size.capacity, -1, 1);
               if (distances) a.distanceGradients = stage.randomInput(size.capacity, -1, 1);
               a.displacementGradients =
                   stage.output("displacementGradients", stage.random.floats(3 * named.vertices(), -1, 1));
               stage.device.run(a);
             }});
  for (const NamedOctahedra& named : octahedraGrids())
    tests.gradients.push_back(
        {named.name, [=](Stage& stage) {
           const uint32_t cells = named.grids[0].cells();
           const Size size{12};
           const OctahedraHits hits(stage.random, named, 5, size.capacity);
           const std::vector<float> positions = stage.random.floats(3 * size.capacity, -1, 1);
           const std::vector<float> distances = stage.random.floats(size.capacity, -1, 1);
           OctahedraBackward a{named.grids};
           a.minCosine = 0;
           hits.setInputs(stage, size, a);
           a.positionGradients = stage.input(positions);
           a.distanceGradients = stage.input(distances);
           const std::vector<float> zeros(3 * named.vertices());
           a.displacementGradients = stage.output("displacementGradients", zeros);
           stage.device.run(a);
           const auto loss = [&](View displacements) {
             double sum = 0;
             for (size_t s = 0; s < size.capacity; ++s) {
               const size_t ray = hits.rayOfSample[s];
               const auto point = [&](const std::vector<float>& values) {
                 return reference::Point{values[3 * ray], values[3 * ray + 1], values[3 * ray + 2]};
               };
               const uint32_t g = hits.faces[s] / kFacesPerCell / cells;
               const OctahedraGrid& grid = named.grids[g];
               const auto hit = reference::hitPlaneOfFace(
                   grid, displacements.subspan(size_t{3} * cells * g, size_t{3} * cells), point(hits.rays.origins),
                   point(hits.rays.directions), hits.faces[s] - kFacesPerCell * cells * g);
               for (int axis = 0; axis < 3; ++axis)
                 sum += positions[3 * s + axis] * hit->position[axis] * grid.positionScale();
               sum += distances[s] * hit->distance;
             }
             return sum;
           };
           const std::vector<uint32_t> all = firstIndices(zeros.size());
           return std::vector<GradientPair>{{"displacements", stage.device.read(a.displacementGradients),
                                             centralDifferences(loss, toDoubles(hits.displacements), 1e-6, all)}};
         }});
  return tests;
}

template <>
OperationTests makeTests<MergeOctahedra>() {
  OperationTests tests;
  tests.noGradient = "it makes the parameters of another level";
  for (const uint32_t resolution : {2u, 6u, 16u})
    for (const uint32_t points : {1u, 5u})
      for (const Layout layout : {Layout::plain, Layout::strided})
        tests.cases.push_back(
            {fmt::format("{} cells, {} points{}", resolution, points, layout == Layout::plain ? "" : ", strided"),
             [=](Stage& stage) {
               const OctahedraGrid grid{resolution};
               std::vector<uint32_t> cells;
               for (uint32_t cell = 0; cell < grid.cells(); ++cell)
                 if (stage.random.below(3) > 0) cells.push_back(cell);
               // Opacities on a lattice, so that rounding cannot choose between two of nearly the same opacity, but
               // some are equal; and transparent ones.
               std::vector<float> logits(points * cells.size());
               for (size_t i = 0; i < cells.size(); ++i) {
                 const float logit =
                     stage.random.below(3) == 0 ? -20.0f : 0.25f * static_cast<float>(stage.random.below(20));
                 for (size_t p = 0; p < points; ++p) logits[p * cells.size() + i] = logit;
               }
               MergeOctahedra a;
               a.resolution = resolution;
               a.points = points;
               a.offset = -2;
               a.cells = stage.input(cells);
               a.x = stage.makeMatrix(logits, 1, layout);
               a.displacements = stage.input(randomDisplacements(stage.random, grid.cells(), 1));
               a.opacities = stage.output("opacities", grid.cells(), 1e-6);
               a.mergedDisplacements = stage.output("mergedDisplacements", size_t{3} * grid.cells() / 8, 1e-6);
               stage.device.run(a);
             }});
  return tests;
}

}  // namespace tessera::device_test

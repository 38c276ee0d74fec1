// The roofline rows of octahedra grids.
#include <fmt/format.h>

#include <algorithm>

#include "compute/octahedra.h"
#include "compute/roofline_recorder.h"

namespace tessera {

void measureOctahedra(RooflineRecorder& recorder) {
  Device& device = recorder.device();
  OctahedraGrid grid{64};
  grid.gridFromScene = {32, 0, 0, 32, 0, 32, 0, 32, 0, 0, 32, 32, 0, 0, 0, 1};
  // The rays look down on three layers of occupied cells, the surface of a scene with its neighbours.
  const uint32_t rays = std::max(1u, recorder.options().streamed / 16), capacity = rays * 16;
  Array<float> origins = recorder.randomFloats(size_t{rays} * 3, -0.9f, 0.9f);
  Array<float> directions = recorder.randomFloats(size_t{rays} * 3, -0.3f, 0.3f);
  std::vector<float> from = device.read(origins.all()), along = device.read(directions.all());
  for (uint32_t r = 0; r < rays; ++r) {
    from[3 * r + 2] = 3;
    along[3 * r + 2] = -1;
  }
  device.write(origins.all(), std::span<const float>(from));
  device.write(directions.all(), std::span<const float>(along));
  std::vector<uint32_t> bits(grid.words());
  for (uint32_t word = 0; word < grid.words(); ++word) {
    const uint32_t k = word * 32 / (grid.resolution * grid.resolution);
    bits[word] = k >= 30 && k < 33 ? ~0u : 0u;
  }
  const Array<uint32_t> occupancy = device.uploadArray(bits);
  const Array<float> displacements = recorder.randomFloats(size_t{3} * grid.cells(), -0.5f, 0.5f);
  Array<uint32_t> first = device.array<uint32_t>(rays + size_t{1}), count = device.array<uint32_t>(1);
  Array<uint32_t> rayOfSample = device.array<uint32_t>(capacity), faces = device.array<uint32_t>(capacity);
  Array<float> barycentrics = device.array<float>(size_t{capacity} * 2), distances = device.array<float>(capacity),
               positions = device.array<float>(size_t{capacity} * 3);
  TraceOctahedra trace{{&grid, 1}};
  trace.rays = {rays};
  trace.sampleCapacity = capacity;
  trace.origins = origins;
  trace.directions = directions;
  trace.displacements = displacements;
  trace.occupancy = occupancy;
  trace.firstSample = first;
  trace.sampleCount = count;
  trace.rayOfSample = rayOfSample;
  trace.faces = faces;
  trace.barycentrics = barycentrics;
  trace.positions = positions;
  trace.distances = distances;
  device.run(trace);
  const double hits = device.read(count.all())[0], vertices = grid.cells();
  const std::string shape = fmt::format("{} rays, {:.1f} hits each", rays, hits / rays);
  const double bytes = rays * 28.0 + hits * 32 + vertices * 12 * 5 / 64 + grid.words() * 4.0;
  recorder.measureStream(kOperation<TraceOctahedra>, shape, bytes, [&] { device.run(trace); });

  Array<float> sums = device.array<float>(size_t{3} * grid.cells());
  OctahedraBackward backward{{&grid, 1}};
  backward.samples = {capacity, count};
  backward.origins = origins;
  backward.directions = directions;
  backward.displacements = displacements;
  backward.rayOfSample = rayOfSample;
  backward.faces = faces;
  backward.barycentrics = barycentrics;
  backward.distances = distances;
  backward.positionGradients = positions;
  backward.displacementGradients = sums;
  recorder.measureStream(kOperation<OctahedraBackward>, fmt::format("{:.0f} hits", hits),
                         hits * (20 + 12 + 72) + rays * 24.0, [&] { device.run(backward); });

  constexpr uint32_t kPoints = 4;
  std::vector<uint32_t> listed(grid.cells());
  for (uint32_t cell = 0; cell < grid.cells(); ++cell) listed[cell] = cell;
  const Array<uint32_t> cells = device.uploadArray(listed);
  const Array<float> logits = recorder.randomFloats(size_t{kPoints} * grid.cells(), -4, 4);
  Array<float> opacities = device.array<float>(grid.cells()),
               merged = device.array<float>(size_t{3} * grid.cells() / 8);
  MergeOctahedra merge;
  merge.resolution = grid.resolution;
  merge.points = kPoints;
  merge.cells = cells;
  merge.x = Matrix<const float>(logits.all(), 1);
  merge.displacements = displacements;
  merge.opacities = opacities;
  merge.mergedDisplacements = merged;
  recorder.measureStream(kOperation<MergeOctahedra>, fmt::format("{} cells, {} points each", grid.cells(), kPoints),
                         vertices * (4 + 4 * kPoints + 4 + 12 + 1.5), [&] { device.run(merge); });
}

}  // namespace tessera

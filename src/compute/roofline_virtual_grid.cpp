// The roofline rows of the virtual grid: samples of one block near the ground, as in training once the ground has been
// learned.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/random.h"
#include "compute/roofline_recorder.h"
#include "compute/virtual_grid.h"

namespace tessera {
namespace {

// Samples on random rays that hit hilly ground: `perRay` samples per ray, within a few texels of the ground.
std::vector<float> positionsNearGround(uint32_t samples, uint32_t perRay) {
  const RandomStream random(1, 0x96d);
  std::vector<float> positions;
  for (uint32_t s = 0; s < samples; ++s) {
    const uint32_t ray = s / perRay;
    const float x = random.uniform(2 * ray), y = random.uniform(2 * ray + 1);
    const float ground = 0.5f + 0.1f * std::sin(9 * x) * std::cos(7 * y);
    const float along = 0.02f * (static_cast<float>(s % perRay) / static_cast<float>(perRay) - 0.5f);
    for (const float p : {x + 0.3f * along, y + 0.2f * along, ground + along}) {
      positions.push_back(std::clamp(p, 0.0f, 1.0f));
    }
  }
  return positions;
}

}  // namespace

void measureVirtualGrid(RooflineRecorder& recorder) {
  constexpr uint32_t kPerRay = 16;
  Device& device = recorder.device();
  const VirtualGrid grid;
  const uint32_t n = recorder.options().samples.front();
  Array<float> positions = device.uploadArray(positionsNearGround(n, kPerRay));
  Array<uint32_t> blocks = device.array<uint32_t>(n), firstTexel = device.array<uint32_t>(2);
  Array<uint32_t> marks = device.array<uint32_t>(grid.words()), ranks = device.array<uint32_t>(grid.words());
  const uint32_t capacity = VirtualGrid::kCorners * n;
  Array<float> texelPositions = device.array<float>(size_t{3} * capacity);
  DistinctTexels distinct{grid};
  distinct.samples = {n};
  distinct.blockOfSample = blocks;
  distinct.positions = positions;
  distinct.texelCapacity = capacity;
  distinct.marks = marks;
  distinct.ranks = ranks;
  distinct.firstTexel = firstTexel;
  distinct.texelPositions = texelPositions;
  device.run(distinct);
  const uint32_t texels = device.read(firstTexel.all())[1];
  const double lookups = static_cast<double>(VirtualGrid::kCorners) * n;
  const std::string shape = fmt::format("{} samples, {} of {} texels", n, texels, grid.texels());
  // `table` is the size of the data in which the corners are looked up, and `bytes` that of the arguments besides
  // positions and blocks. The limit is the slower of the lookups and of moving the arguments once.
  const auto measure = [&](const OperationId& operation, size_t table, double bytes, const std::function<void()>& run) {
    const double moved = bytes + 16.0 * n;
    const double limit = std::min(recorder.gatherLimit(table), lookups / moved * recorder.streamLimit(moved));
    const std::string name(operation.name());
    recorder.measure(operation, {name, shape, lookups, "lookup", limit}, run);
  };
  const double bits = 8.0 * grid.words(), attributeBytes = 4.0 * VirtualGrid::kAttributes;
  measure(kOperation<DistinctTexels>, size_t{grid.words()} * 4, bits + 12.0 * texels, [&] { device.run(distinct); });

  Array<float> attributes = recorder.randomFloats(size_t{VirtualGrid::kAttributes} * texels, 0, 1);
  Array<float> logDensities = device.array<float>(n), colours = device.array<float>(size_t{n} * 7);
  VirtualGridForward forward{grid};
  forward.samples = {n};
  forward.blockOfSample = blocks;
  forward.positions = positions;
  forward.marks = marks;
  forward.ranks = ranks;
  forward.texels = {texels};
  forward.attributes = attributes;
  forward.logDensities = logDensities;
  forward.colours = colours;
  measure(kOperation<VirtualGridForward>, size_t{texels} * VirtualGrid::kAttributes,
          bits + attributeBytes * (texels + n), [&] { device.run(forward); });

  Array<float> densityGradients = recorder.randomFloats(n, -1, 1);
  Array<float> colourGradients = recorder.randomFloats(size_t{n} * 7, -1, 1);
  Array<float> attributeGradients = device.array<float>(size_t{VirtualGrid::kAttributes} * texels);
  VirtualGridBackward backward{grid};
  backward.samples = {n};
  backward.blockOfSample = blocks;
  backward.positions = positions;
  backward.marks = marks;
  backward.ranks = ranks;
  backward.firstTexel = firstTexel;
  backward.texels = {texels};
  backward.logDensities = logDensities;
  backward.colours = colours;
  backward.logDensityGradients = densityGradients;
  backward.colourGradients = colourGradients;
  backward.attributeGradients = attributeGradients;
  measure(kOperation<VirtualGridBackward>, size_t{texels} * VirtualGrid::kAttributes * sizeof(float),
          bits + attributeBytes * (texels + 2.0 * n), [&] { device.run(backward); });
}

}  // namespace tessera

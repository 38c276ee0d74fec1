// The roofline rows of the operations of NGP-RT: marching through blocks, the lattice, fusing levels and shading rays.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "compute/attention.h"
#include "compute/block_march.h"
#include "compute/blocks.h"
#include "compute/lattice.h"
#include "compute/roofline_recorder.h"
#include "compute/rows.h"
#include "compute/virtual_grid.h"

namespace tessera {
namespace {

constexpr uint32_t kPerRay = 16;

// Samples near hilly ground, as positions in [0,1]³, with `kPerRay` samples per ray.
std::vector<float> positionsNearGround(uint32_t samples) {
  const std::vector<float> anywhere = rayLikePositions((samples + kPerRay - 1) / kPerRay, kPerRay, 3);
  std::vector<float> positions(anywhere.begin(), anywhere.begin() + size_t{3} * samples);
  for (uint32_t s = 0; s < samples; ++s) {
    float* p = &positions[3 * s];
    p[2] = 0.5f + 0.1f * std::sin(9 * p[0]) * std::cos(7 * p[1]) + 0.02f * (p[2] - 0.5f);
  }
  return positions;
}

void measureMarch(RooflineRecorder& recorder) {
  Device& device = recorder.device();
  const BlockSpace space{.columns = 3, .rows = 2};
  MarchBlocks march{space};
  march.cells = 64;
  const uint32_t rays = std::max(1u, recorder.options().streamed / 64), capacity = rays * 64;
  // The rays look straight down on the grid from above; a horizontal slab of each block is occupied.
  Array<float> origins = recorder.randomFloats(size_t{rays} * 3, -2, 2);
  std::vector<float> from = device.read(origins.all()), along(from.size());
  for (uint32_t r = 0; r < rays; ++r) {
    from[3 * r + 2] = 2;
    along[3 * r + 2] = -1;
  }
  device.write(origins.all(), std::span<const float>(from));
  const Array<float> directions = device.uploadArray(along);
  const size_t words = size_t{march.cells} * march.cells * march.cells / 32;
  std::vector<uint32_t> bits(words * space.blocks());
  for (size_t word = 0; word < bits.size(); ++word) {
    const size_t z = word % words * 32 / (march.cells * march.cells);
    bits[word] = z >= 28 && z < 36 ? ~0u : 0u;
  }
  const Array<uint32_t> occupancy = device.uploadArray(bits);
  Array<uint32_t> first = device.array<uint32_t>(rays + size_t{1}), count = device.array<uint32_t>(1);
  Array<uint32_t> rayOfSample = device.array<uint32_t>(capacity), slots = device.array<uint32_t>(capacity);
  Array<float> positions = device.array<float>(size_t{capacity} * 3), distances = device.array<float>(capacity),
               steps = device.array<float>(capacity), middles = device.array<float>(capacity),
               widths = device.array<float>(capacity);
  march.rays = {rays};
  march.sampleCapacity = capacity;
  march.origins = origins;
  march.directions = directions;
  march.occupancy = occupancy;
  march.firstSample = first;
  march.sampleCount = count;
  march.rayOfSample = rayOfSample;
  march.slotOfSample = slots;
  march.positions = positions;
  march.distances = distances;
  march.steps = steps;
  march.middles = middles;
  march.widths = widths;
  device.run(march);
  const uint32_t sampleCount = device.read(count.all())[0];
  recorder.measureStream(kOperation<MarchBlocks>, fmt::format("{} rays, {} samples", rays, sampleCount),
                         sampleCount * 36.0 + rays * 28.0, [&] { device.run(march); });
}

// Measures the lattice of one block with samples like those of training.
void measureLattice(RooflineRecorder& recorder) {
  Device& device = recorder.device();
  constexpr uint32_t kColumns = LatticeForward::kColumns;
  VirtualGrid grid;
  grid.planes = 0;
  const uint32_t n = recorder.options().samples.front(), capacity = 8 * n;
  const Array<float> positions = device.uploadArray(positionsNearGround(n));
  Array<uint32_t> blocks = device.array<uint32_t>(n), firstTexel = device.array<uint32_t>(2);
  Array<uint32_t> marks = device.array<uint32_t>(grid.words()), ranks = device.array<uint32_t>(grid.words());
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
  const double lookups = 8.0 * n, bits = 8.0 * grid.words(), row = 4.0 * kColumns;
  const std::string shape = fmt::format("{} samples, {} of {} corners", n, texels, grid.texels());
  // As for the virtual grid, the limit is the slower of the lookups and of moving the arguments once.
  const auto measure = [&](const OperationId& operation, double bytes, const std::function<void()>& run) {
    const double moved = bytes + 16.0 * n;
    const double limit =
        std::min(recorder.gatherLimit(size_t{texels} * kColumns * 4), lookups / moved * recorder.streamLimit(moved));
    const std::string name(operation.name());
    recorder.measure(operation, {name, shape, lookups, "lookup", limit}, run);
  };
  Array<float> values = recorder.randomFloats(size_t{kColumns} * texels, -1, 1);
  Array<float> mixed = device.array<float>(size_t{kColumns} * n);
  LatticeForward forward{grid};
  forward.samples = {n};
  forward.blockOfSample = blocks;
  forward.positions = positions;
  forward.marks = marks;
  forward.ranks = ranks;
  forward.texels = {texels};
  forward.values = values;
  forward.mixed = Matrix<float>(mixed, kColumns);
  measure(kOperation<LatticeForward>, bits + row * (texels + n), [&] { device.run(forward); });
  LatticeBackward backward{grid};
  backward.samples = {n};
  backward.blockOfSample = blocks;
  backward.positions = positions;
  backward.marks = marks;
  backward.ranks = ranks;
  backward.firstTexel = firstTexel;
  backward.texels = {texels};
  backward.mixedGradients = Matrix<float>(mixed, kColumns);
  backward.valueGradients = values;
  measure(kOperation<LatticeBackward>, bits + row * (texels + n), [&] { device.run(backward); });
}

void measureFusion(RooflineRecorder& recorder) {
  Device& device = recorder.device();
  constexpr uint32_t kFeatures = AttentionShape::kFeatures, kCoarse = 16;
  const AttentionShape attention;
  const uint32_t n = std::max(1u, recorder.options().streamed / 4), fineColumns = kFeatures * attention.levels;
  const std::string shape = fmt::format("{} levels, {} samples", attention.levels, n);
  Array<float> coarse = recorder.randomFloats(size_t{kCoarse} * n, -1, 1),
               fine = recorder.randomFloats(size_t{fineColumns} * n, -1, 1),
               features = recorder.randomFloats(size_t{kFeatures} * n, -1, 1),
               coarseGradients = device.array<float>(size_t{kCoarse} * n),
               fineGradients = device.array<float>(size_t{fineColumns} * n), densityGradients = device.array<float>(n);
  const Matrix<float> ofFine = Matrix<float>::grouped(fine, fineColumns, kFeatures, n);
  const Matrix<float> ofFineGradients = Matrix<float>::grouped(fineGradients, fineColumns, kFeatures, n);
  const Matrix<float> fused(features, kFeatures);
  recorder.measureStream(kOperation<AttentionForward>, shape, n * 4.0 * (kCoarse + fineColumns + kFeatures), [&] {
    device.run(AttentionForward{attention, {n}, Matrix<float>(coarse, kCoarse), ofFine, {}, fused});
  });
  recorder.measureStream(kOperation<AttentionBackward>, shape, n * 4.0 * (2 * (kCoarse + fineColumns) + kFeatures),
                         [&] {
                           device.run(AttentionBackward{attention,
                                                        {n},
                                                        Matrix<float>(coarse, kCoarse),
                                                        ofFine,
                                                        {},
                                                        densityGradients,
                                                        fused.columnRange(1, kFeatures - 1),
                                                        Matrix<float>(coarseGradients, kCoarse),
                                                        ofFineGradients,
                                                        {}});
                         });
  const Matrix<float> diffuse = fused.columnRange(0, 3), specular(fineGradients, 3), sums(coarseGradients, 3);
  Array<float> colour = device.array<float>(size_t{3} * n);
  const std::string rays = fmt::format("{} rays", n);
  recorder.measureStream(kOperation<ShadeForward>, rays, n * 40.0, [&] {
    device.run(ShadeForward{false, {n}, diffuse, specular, densityGradients, colour});
  });
  recorder.measureStream(kOperation<ShadeBackward>, rays, n * 56.0, [&] {
    device.run(ShadeBackward{false, {n}, diffuse, specular, densityGradients, colour, sums, densityGradients});
  });
  recorder.measureStream(kOperation<AddColumns>, fmt::format("8 columns, {} rows", n), n * 96.0, [&] {
    device.run(AddColumns{{n}, Matrix<float>(coarse, kFeatures), fused});
  });
}

}  // namespace

void measureAttention(RooflineRecorder& recorder) {
  measureMarch(recorder);
  measureLattice(recorder);
  measureFusion(recorder);
}

}  // namespace tessera

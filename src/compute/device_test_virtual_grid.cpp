// Test cases of the virtual grid.
#include <fmt/format.h>

#include <algorithm>

#include "compute/device_test.h"
#include "compute/testing/test_texel_batch.h"

namespace tessera::device_test {
namespace {

constexpr uint32_t kBlocks = TexelBatch::kBlocks, kCorners = VirtualGrid::kCorners, kWidth = VirtualGrid::kAttributes;

// Small grids, whose few texels are shared by many samples but whose marks need more than one word. Some resolutions
// are not powers of two, and some are odd.
std::vector<VirtualGrid> grids() {
  std::vector<VirtualGrid> all;
  for (bool quantise : {true, false})
    for (bool share : {true, false}) {
      VirtualGrid grid;
      grid.voxels = quantise ? 8 : 5;
      grid.planes = quantise ? 24 : 19;
      grid.quantise = quantise;
      grid.shareTexels = share;
      all.push_back(grid);
    }
  return all;
}

std::string gridName(const VirtualGrid& grid) {
  return fmt::format("{}³ and {}²{}{}", grid.voxels, grid.planes, grid.quantise ? ", quantised" : "",
                     grid.shareTexels ? "" : ", each corner");
}

}  // namespace

template <>
OperationTests makeTests<DistinctTexels>() {
  OperationTests tests;
  tests.noGradient = "it chooses texels";
  std::vector<VirtualGrid> all = grids();
  for (VirtualGrid grid : grids()) {
    grid.planes = 0;
    all.push_back(grid);
  }
  for (const VirtualGrid& grid : all)
    for (const Size& size : kSizes)
      for (bool tight : {false, true})
        tests.cases.push_back(
            {fmt::format("{}, samples {}{}", gridName(grid), toString(size), tight ? ", no room" : ""),
             [=](Stage& stage) {
               const TexelBatch batch(stage, grid, size);
               DistinctTexels a{grid};
               a.blocks = kBlocks;
               a.samples = stage.count(size);
               a.blockOfSample = stage.input(batch.blocks);
               a.positions = stage.input(batch.positions);
               a.texelCapacity = tight ? batch.texels / 2 : batch.texels + 5;
               if (grid.shareTexels) {
                 a.marks = stage.outputWords("marks", kBlocks * grid.words());
                 a.ranks = stage.outputWords("ranks", kBlocks * grid.words());
               }
               a.firstTexel = stage.outputWords("firstTexel", kBlocks + 1);
               a.texelPositions = stage.output("texelPositions", size_t{3} * a.texelCapacity, 1e-7);
               stage.device.run(a);
             }});
  return tests;
}

template <>
OperationTests makeTests<VirtualGridForward>() {
  OperationTests tests;
  tests.noGradient = "its gradient is VirtualGridBackward";
  for (const VirtualGrid& grid : grids())
    for (const Size& size : kSizes)
      for (bool culled : {false, true})
        tests.cases.push_back(
            {fmt::format("{}, samples {}{}", gridName(grid), toString(size), culled ? ", culled, no room" : ""),
             [=](Stage& stage) {
               const TexelBatch batch(stage, grid, size);
               VirtualGridForward a{grid};
               batch.set(stage, size, a);
               a.texels = stage.count({culled ? batch.texels / 2 : batch.texels + 5, batch.texels});
               a.attributes = stage.randomInput(size_t{kWidth} * a.texels.capacity, 0.2f, 0.9f);
               if (culled) {
                 a.minAlpha = 0.3f;
                 a.runtimeSteps = stage.randomInput(size.capacity, 0, 0.02f);
               }
               a.logDensities = stage.output("logDensities", size.capacity);
               a.colours = stage.output("colours", size_t{kWidth - 1} * size.capacity);
               stage.device.run(a);
             }});
  return tests;
}

template <>
OperationTests makeTests<VirtualGridBackward>() {
  OperationTests tests;
  for (const VirtualGrid& grid : grids())
    for (const Size& size : kSizes)
      for (bool tight : {false, true})
        tests.cases.push_back(
            {fmt::format("{}, samples {}{}", gridName(grid), toString(size), tight ? ", no room" : ""),
             [=](Stage& stage) {
               const TexelBatch batch(stage, grid, size);
               VirtualGridBackward a{grid};
               batch.set(stage, size, a);
               a.blocks = kBlocks;
               a.firstTexel = stage.input(batch.first);
               a.texels = stage.count({tight ? batch.texels / 2 : batch.texels + 5, batch.texels});
               std::vector<float> logDensities = stage.random.floats(size.capacity, -3, 3);
               for (size_t i = 0; i < logDensities.size(); i += 5) logDensities[i] = i % 2 ? VirtualGrid::kCulled : 15;
               std::vector<float> gradients = stage.random.floats(size.capacity, -1, 1);
               std::vector<float> colourGradients = stage.random.floats(size_t{kWidth - 1} * size.capacity, -1, 1);
               for (size_t i = 0; i < gradients.size(); i += 3) {  // zero, as behind a surface
                 gradients[i] = 0;
                 std::fill_n(colourGradients.begin() + static_cast<ptrdiff_t>(i * (kWidth - 1)), kWidth - 1, 0.0f);
               }
               a.logDensities = stage.input(logDensities);
               a.colours = stage.randomInput(size_t{kWidth - 1} * size.capacity, 0, 1);
               a.logDensityGradients = stage.input(gradients);
               a.colourGradients = stage.input(colourGradients);
               a.attributeGradients = stage.output("attributeGradients", size_t{kWidth} * a.texels.capacity);
               stage.device.run(a);
             }});
  for (VirtualGrid grid : grids()) {
    if (grid.quantise)
      grid.quantise = false;  // rounding passes gradients straight through, but affects finite differences
    tests.gradients.push_back(
        {gridName(grid), [=](Stage& stage) {
           const Size size{7};
           const TexelBatch batch(stage, grid, size);
           const std::vector<float> attributes = stage.random.floats(size_t{kWidth} * batch.texels, 0.4f, 0.6f);
           const std::vector<float> upstream = stage.random.floats(kWidth * size.capacity, -1, 1);
           const auto sampleAt = [&](View moved, size_t s) {
             const float* p = &batch.positions[3 * s];
             const auto corners = reference::virtualCorners(grid, {p[0], p[1], p[2]});
             Doubles ofCorners;
             for (size_t k = 0; k < kCorners; ++k) {
               size_t row = s * kCorners + k;
               if (grid.shareTexels) {
                 const uint32_t texel = corners[k].texel;
                 const size_t word = batch.blocks[s] * grid.words() + texel / 32;
                 row = batch.ranks[word] + std::popcount(batch.marks[word] & ((1u << texel % 32) - 1));
               }
               for (size_t f = 0; f < kWidth; ++f) ofCorners.push_back(moved[row * kWidth + f]);
             }
             return reference::virtualSample(grid, corners, ofCorners);
           };
           std::vector<float> logDensities, colours, densityGradients, colourGradients;
           for (size_t s = 0; s < size.capacity; ++s) {
             const Doubles sample = sampleAt(toDoubles(attributes), s);
             logDensities.push_back(static_cast<float>(sample[0]));
             densityGradients.push_back(upstream[s * kWidth]);
             for (size_t f = 1; f < kWidth; ++f) {
               colours.push_back(static_cast<float>(sample[f]));
               colourGradients.push_back(upstream[s * kWidth + f]);
             }
           }
           VirtualGridBackward a{grid};
           batch.set(stage, size, a);
           a.blocks = kBlocks;
           a.firstTexel = stage.input(batch.first);
           a.texels = stage.count({batch.texels});
           a.logDensities = stage.input(logDensities);
           a.colours = stage.input(colours);
           a.logDensityGradients = stage.input(densityGradients);
           a.colourGradients = stage.input(colourGradients);
           a.attributeGradients = stage.output("attributeGradients", attributes.size());
           stage.device.run(a);
           const auto loss = [&](View moved) {
             double sum = 0;
             for (size_t s = 0; s < size.capacity; ++s) {
               const Doubles sample = sampleAt(moved, s);
               for (size_t f = 0; f < kWidth; ++f) sum += upstream[s * kWidth + f] * sample[f];
             }
             return sum;
           };
           const std::vector<uint32_t> some = stage.random.wordsBelow(200, static_cast<uint32_t>(attributes.size()));
           return std::vector<GradientPair>{{"attributes", pick(stage.device.read(a.attributeGradients), some),
                                             centralDifferences(loss, toDoubles(attributes), 1e-5, some)}};
         }});
  }
  return tests;
}

}  // namespace tessera::device_test

// Test cases of the lattice.
#include <fmt/format.h>

#include <algorithm>

#include "compute/device_test.h"
#include "compute/lattice.h"
#include "compute/testing/test_texel_batch.h"

namespace tessera::device_test {
namespace {

constexpr uint32_t kColumns = LatticeForward::kColumns;

VirtualGrid makeLattice(bool share) {
  VirtualGrid grid;
  grid.voxels = share ? 8 : 5;
  grid.planes = 0;
  grid.shareTexels = share;
  return grid;
}

// A matrix that is grouped, as hash grids write it, or row-major.
Matrix<float> columnsIn(Slice<float> buffer, size_t rows, bool grouped) {
  return grouped ? Matrix<float>::grouped(buffer, kColumns, 8, rows) : Matrix<float>(buffer, kColumns);
}

}  // namespace

template <>
OperationTests makeTests<LatticeForward>() {
  OperationTests tests;
  tests.noGradient = "its gradient is LatticeBackward";
  for (bool share : {true, false})
    for (const Size& size : kSizes)
      for (bool tight : {false, true})
        tests.cases.push_back(
            {fmt::format("samples {}{}{}", toString(size), share ? "" : ", each corner", tight ? ", no room" : ""),
             [=](Stage& stage) {
               const VirtualGrid grid = makeLattice(share);
               const TexelBatch batch(stage, grid, size);
               LatticeForward a{grid};
               batch.set(stage, size, a);
               a.texels = stage.count({tight ? batch.texels / 2 : batch.texels + 5, batch.texels});
               a.values = stage.randomInput(size_t{kColumns} * a.texels.capacity, -3, 3);
               a.mixed = columnsIn(stage.output("mixed", size_t{kColumns} * size.capacity), size.capacity, tight);
               stage.device.run(a);
             }});
  return tests;
}

template <>
OperationTests makeTests<LatticeBackward>() {
  OperationTests tests;
  for (bool share : {true, false})
    for (const Size& size : kSizes)
      for (bool tight : {false, true})
        tests.cases.push_back(
            {fmt::format("samples {}{}{}", toString(size), share ? "" : ", each corner", tight ? ", no room" : ""),
             [=](Stage& stage) {
               const VirtualGrid grid = makeLattice(share);
               const TexelBatch batch(stage, grid, size);
               LatticeBackward a{grid};
               batch.set(stage, size, a);
               a.blocks = TexelBatch::kBlocks;
               a.firstTexel = stage.input(batch.first);
               a.texels = stage.count({tight ? batch.texels / 2 : batch.texels + 5, batch.texels});
               a.mixedGradients =
                   columnsIn(stage.randomInput(size_t{kColumns} * size.capacity, -1, 1), size.capacity, tight);
               a.valueGradients = stage.output("valueGradients", size_t{kColumns} * a.texels.capacity);
               stage.device.run(a);
             }});
  for (bool share : {true, false})
    tests.gradients.push_back(
        {share ? "shared corners" : "each corner", [=](Stage& stage) {
           const Size size{7};
           const VirtualGrid grid = makeLattice(share);
           const TexelBatch batch(stage, grid, size);
           const std::vector<float> values = stage.random.floats(size_t{kColumns} * batch.texels, -3, 3);
           const std::vector<float> upstream = stage.random.floats(kColumns * size.capacity, -1, 1);
           LatticeBackward a{grid};
           batch.set(stage, size, a);
           a.blocks = TexelBatch::kBlocks;
           a.firstTexel = stage.input(batch.first);
           a.texels = stage.count({batch.texels});
           a.mixedGradients = Matrix<float>(stage.input(upstream), kColumns);
           a.valueGradients = stage.output("valueGradients", values.size());
           stage.device.run(a);
           const auto loss = [&](View moved) {
             double sum = 0;
             for (size_t s = 0; s < size.capacity; ++s) {
               const float* p = &batch.positions[3 * s];
               const auto corners = reference::virtualCorners(grid, {p[0], p[1], p[2]});
               for (size_t k = 0; k < corners.size(); ++k) {
                 const size_t row =
                     reference::virtualRow(grid, batch.marks, batch.ranks, batch.blocks[s], s, k, corners[k].texel);
                 for (size_t c = 0; c < kColumns; ++c) {
                   sum += upstream[kColumns * s + c] * corners[k].weight * moved[kColumns * row + c];
                 }
               }
             }
             return sum;
           };
           const std::vector<uint32_t> some = stage.random.wordsBelow(200, static_cast<uint32_t>(values.size()));
           return std::vector<GradientPair>{{"values", pick(stage.device.read(a.valueGradients), some),
                                             centralDifferences(loss, toDoubles(values), 1e-3, some)}};
         }});
  return tests;
}

}  // namespace tessera::device_test

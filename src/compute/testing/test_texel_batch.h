// Samples and the texels from which they are interpolated, for tests.
#pragma once

#include "compute/device_test.h"
#include "compute/virtual_grid.h"

namespace tessera::device_test {

// Samples inside and on the border of their blocks, and the texels that they need, as found by DistinctTexels.
struct TexelBatch {
  static constexpr uint32_t kBlocks = 3;

  std::vector<uint32_t> blocks, marks, ranks, first;
  std::vector<float> positions;
  uint32_t texels = 0;

  TexelBatch(Stage& stage, const VirtualGrid& grid, const Size& size) {
    blocks = stage.random.wordsBelow(size.capacity, kBlocks);
    for (uint32_t& block : blocks) block = block == 1 ? 2 : block;  // block 1 has no samples
    positions = stage.random.floats(size_t{3} * size.capacity, 0, 1);
    for (size_t i = 0; i < positions.size(); i += 17) positions[i] = i % 2 ? 0.0f : 1.0f;
    Device& reference = *deviceNamed("reference");
    Stage own(reference, 1);
    DistinctTexels a{grid};
    a.blocks = kBlocks;
    a.samples = own.count(size);
    a.blockOfSample = own.input(blocks);
    a.positions = own.input(positions);
    a.marks = own.input(std::vector<uint32_t>(kBlocks * grid.words()));
    a.ranks = own.input(std::vector<uint32_t>(kBlocks * grid.words()));
    a.firstTexel = own.input(std::vector<uint32_t>(kBlocks + 1));
    reference.run(a);
    marks = reference.read(a.marks);
    ranks = reference.read(a.ranks);
    first = reference.read(a.firstTexel);
    texels = first.back();
  }

  template <class Arguments>
  void set(Stage& stage, const Size& size, Arguments& a) const {
    a.samples = stage.count(size);
    a.blockOfSample = stage.input(blocks);
    a.positions = stage.input(positions);
    if (a.grid.shareTexels) {
      a.marks = stage.input(marks);
      a.ranks = stage.input(ranks);
    }
  }
};

}  // namespace tessera::device_test

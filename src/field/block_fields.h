// One small field per block, all of the same shape: a hash grid and a network from its features to a few outputs. These
// are the attribute functions f^k and the proposal fields ψ^k of City-on-Web. Samples are sorted by slot, and each
// field evaluates its own rows. There is one slot for each resident block.
#pragma once

#include <deque>

#include "compute/hash_grid.h"
#include "compute/mlp.h"
#include "field/parameters.h"

namespace tessera {

struct BlockFieldShape {
  HashGrid grid;
  MlpShape network;  // grid columns → outputs
};
BlockFieldShape makeBlockFieldShape(const HashGridOptions& grid, int width, int hiddenLayers, int outputs,
                                    OutputActivation activation);

// The samples of all blocks, with the intermediate values of forward that backward needs.
struct BlockFieldBatch {
  uint32_t capacity = 0;
  Slice<const uint32_t> firstOfSlot;  // [slots + 1], rows
  Slice<const float> positions;       // [capacity][3] in [0,1]
  Array<float> encoded, encodedGradients, activations;
  Array<float> outputs, outputGradients;  // [capacity][outputs]

  BlockFieldBatch() = default;
  BlockFieldBatch(Device& device, const BlockFieldShape& shape, uint32_t rows, bool forBackward);
};

class BlockFields {
 public:
  // `name`: the parameter groups are named NAME.table and NAME.network. Initially slot k holds block k. Keeps a
  // reference to `device`.
  BlockFields(Device& device, std::string name, BlockFieldShape shape, uint32_t slots, uint64_t seed,
              bool forTraining = true);

  // Write the untrained field of a block into a slot, replacing its contents, or into tensors to save.
  void begin(uint32_t slot, uint32_t block);
  void saveFirst(uint32_t block, TensorSet& tensors) const;

  void forward(BlockFieldBatch& batch, bool forBackward);  // writes batch.outputs
  // Propagates batch.outputGradients (with respect to the activated outputs); adds to the gradients of the groups.
  void backward(BlockFieldBatch& batch);

  uint32_t slots() const { return static_cast<uint32_t>(tables_.size()); }
  ParameterGroup& table(uint32_t slot) { return tables_[slot]; }
  ParameterGroup& network(uint32_t slot) { return networks_[slot]; }
  const BlockFieldShape& shape() const { return shape_; }

 private:
  Matrix<float> byLevel(Array<float>& encodings, uint32_t capacity) const;
  static Count slotRows(const BlockFieldBatch& batch, uint32_t slot);

  std::vector<float> firstTable(uint32_t block) const;
  std::vector<float> firstNetwork(uint32_t block) const;

  Device& device_;
  BlockFieldShape shape_;
  uint64_t seed_ = 0;
  std::deque<ParameterGroup> tables_, networks_;  // [slots]
};

}  // namespace tessera

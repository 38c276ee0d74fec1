// One small field a block, all of the same shape: a hash grid and a network from its features to a few outputs. Samples
// come sorted by block; each block's field sees its own rows. City-on-Web's attribute functions f^k and proposal fields
// ψ^k. Fields stand in slots, one for each block that is in memory.
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

// Samples of all blocks, and what is kept of them between forward and backward.
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
  // `name`: of the parameter groups, NAME.table and NAME.network. Slot k begins with block k. Keeps a reference to
  // `device`.
  BlockFields(Device& device, std::string name, BlockFieldShape shape, uint32_t slots, uint64_t seed,
              bool forTraining = true);

  // A block's field as it begins: in a slot, whatever that held; or saved.
  void begin(uint32_t slot, uint32_t block);
  void saveFirst(uint32_t block, TensorSet& tensors) const;

  void forward(BlockFieldBatch& batch, bool forBackward);  // to batch.outputs
  // From batch.outputGradients (of the activated outputs). Adds to the groups' gradients.
  void backward(BlockFieldBatch& batch);

  uint32_t slots() const { return static_cast<uint32_t>(tables_.size()); }
  ParameterGroup& table(uint32_t slot) { return tables_[slot]; }
  ParameterGroup& network(uint32_t slot) { return networks_[slot]; }
  const BlockFieldShape& shape() const { return shape_; }

 private:
  Matrix<float> byLevel(Array<float>& encodings, uint32_t capacity) const;
  static Count rowsOf(const BlockFieldBatch& batch, uint32_t slot);

  std::vector<float> firstTable(uint32_t block) const;
  std::vector<float> firstNetwork(uint32_t block) const;

  Device& device_;
  BlockFieldShape shape_;
  uint64_t seed_ = 0;
  std::deque<ParameterGroup> tables_, networks_;  // [slots]
};

}  // namespace tessera

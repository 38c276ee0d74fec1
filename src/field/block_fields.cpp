#include "field/block_fields.h"

#include "base/random.h"
#include "field/initial_values.h"

namespace tessera {

BlockFieldShape makeBlockFieldShape(const HashGridOptions& grid, int width, int hiddenLayers, int outputs,
                                    OutputActivation activation) {
  BlockFieldShape shape{HashGrid(grid), {}};
  shape.network.inputs = static_cast<int>(shape.grid.columns());
  shape.network.width = width;
  shape.network.hiddenLayers = hiddenLayers;
  shape.network.outputs = outputs;
  shape.network.activation = activation;
  return shape;
}

BlockFieldBatch::BlockFieldBatch(Device& device, const BlockFieldShape& shape, uint32_t rows, bool forBackward)
    : capacity(rows) {
  const size_t n = rows;
  const size_t encodings = Matrix<float>::rowsOfPlane(n) * shape.grid.columns();
  encoded = device.array<float>(encodings);
  outputs = device.array<float>(n * static_cast<size_t>(shape.network.outputs));
  if (!forBackward) return;
  encodedGradients = device.array<float>(encodings);
  activations = device.allocateActivations(shape.network, n);
  outputGradients = device.array<float>(n * static_cast<size_t>(shape.network.outputs));
}

BlockFields::BlockFields(Device& device, std::string name, BlockFieldShape shape, uint32_t slots, uint64_t seed,
                         bool forTraining)
    : device_(device), shape_(std::move(shape)), seed_(seed) {
  for (uint32_t slot = 0; slot < slots; ++slot) {
    tables_.emplace_back(device, name + ".table", firstTable(slot), forTraining);
    networks_.emplace_back(device, name + ".network", firstNetwork(slot), forTraining);
  }
}

std::vector<float> BlockFields::firstTable(uint32_t block) const {
  return initialTable(shape_.grid.parameters(), mix64(seed_ ^ (uint64_t{block} << 32)));
}

std::vector<float> BlockFields::firstNetwork(uint32_t block) const {
  return initialWeights(shape_.network, mix64(seed_ ^ (uint64_t{block} << 32)), 0xb10c);
}

void BlockFields::begin(uint32_t slot, uint32_t block) {
  tables_[slot].begin(device_, firstTable(block));
  networks_[slot].begin(device_, firstNetwork(block));
}

void BlockFields::saveFirst(uint32_t block, TensorSet& tensors) const {
  tensors.add(tables_.front().name, firstTable(block));
  tensors.add(networks_.front().name, firstNetwork(block));
}

Matrix<float> BlockFields::byLevel(Array<float>& encodings, uint32_t capacity) const {
  return Matrix<float>::grouped(encodings, shape_.grid.columns(), static_cast<uint32_t>(shape_.grid.features),
                                Matrix<float>::rowsOfPlane(capacity));
}

Count BlockFields::slotRows(const BlockFieldBatch& batch, uint32_t slot) {
  return {batch.capacity, batch.firstOfSlot.part(slot + 1, 1), batch.firstOfSlot.part(slot, 1)};
}

void BlockFields::forward(BlockFieldBatch& batch, bool forBackward) {
  const Matrix<float> encoded = byLevel(batch.encoded, batch.capacity);
  for (uint32_t slot = 0; slot < slots(); ++slot) {
    const Count rows = slotRows(batch, slot);
    device_.run(HashGridForward{shape_.grid, rows, batch.positions, tables_[slot].values, encoded});
    device_.run(MlpForward{shape_.network, rows, encoded, networks_[slot].values,
                           Matrix<float>(batch.outputs, static_cast<uint32_t>(shape_.network.outputs)),
                           forBackward ? batch.activations.all() : Slice<float>()});
  }
}

void BlockFields::backward(BlockFieldBatch& batch) {
  const uint32_t outputs = static_cast<uint32_t>(shape_.network.outputs);
  const Matrix<float> encoded = byLevel(batch.encoded, batch.capacity);
  const Matrix<float> encodedGradients = byLevel(batch.encodedGradients, batch.capacity);
  for (uint32_t slot = 0; slot < slots(); ++slot) {
    const Count rows = slotRows(batch, slot);
    device_.run(MlpBackward{shape_.network,
                            rows,
                            encoded,
                            networks_[slot].values,
                            Matrix<float>(batch.outputs, outputs),
                            batch.activations,
                            Matrix<float>(batch.outputGradients, outputs),
                            {},
                            networks_[slot].gradients,
                            encodedGradients});
    device_.run(HashGridBackward{
        shape_.grid, rows, batch.positions, tables_[slot].values, encodedGradients, tables_[slot].gradients, {}});
  }
}

}  // namespace tessera

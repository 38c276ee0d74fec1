// Evaluates the network of a content on the CPU.
#pragma once

#include <cstddef>
#include <vector>

#include "tiles/dense_layer.h"

namespace tessera {

// A dense network with ReLU. The weights are stored input-major, so that SIMD vectors run over the outputs.
class DenseNetwork {
 public:
  static constexpr uint32_t kMaxWidth = kMaxLayerWidth;

  // `layers`: inputs → … → outputs, no layer wider than kMaxWidth. `layers` is copied.
  DenseNetwork(const std::vector<DenseLayer>& layers, uint32_t inputs, uint32_t outputs);

  // Replaces the inputs in `values` [kMaxWidth] by the outputs. No activation is applied to the outputs.
  void run(float* values) const;
  // Evaluates kPacket columns of values side by side: [kMaxWidth][kPacket], aligned to 64 bytes.
  void runPacket(float* values) const;
  static constexpr size_t kPacket = 16;

  struct Layer {
    uint32_t inputs = 0, outputs = 0;  // the outputs are rounded up to whole vectors
    std::vector<float> weights;        // [inputs][outputs]
    std::vector<float> biases;         // [outputs]
  };
  const std::vector<Layer>& layers() const { return layers_; }
  uint64_t memoryBytes() const;

 private:
  std::vector<Layer> layers_;
};

}  // namespace tessera

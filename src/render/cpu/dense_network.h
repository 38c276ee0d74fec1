// A content's network, run on the processor.
#pragma once

#include <cstddef>
#include <vector>

#include "tiles/dense_layer.h"

namespace tessera {

// Its weights are laid out for vectors over the outputs.
class DenseNetwork {
 public:
  static constexpr uint32_t kMostWidth = kMostLayerWidth;

  // inputs → … → outputs, no layer wider than kMostWidth. Keeps nothing of `layers`.
  DenseNetwork(const std::vector<DenseLayer>& layers, uint32_t inputs, uint32_t outputs);

  // Overwrites `values` [kMostWidth], which holds the inputs, with the outputs; nothing is applied to these.
  void run(float* values) const;
  // The same for kPacket columns of values side by side: [kMostWidth][kPacket], aligned to 64 bytes.
  void runPacket(float* values) const;
  static constexpr size_t kPacket = 16;

  struct Layer {
    uint32_t inputs = 0, outputs = 0;  // the outputs rounded up to whole vectors
    std::vector<float> weights;        // [inputs][outputs]
    std::vector<float> biases;         // [outputs]
  };
  const std::vector<Layer>& layers() const { return layers_; }

 private:
  std::vector<Layer> layers_;
};

}  // namespace tessera

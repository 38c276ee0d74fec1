// The layers of a small network of a content in memory.
#pragma once

#include <cstdint>
#include <vector>

namespace tessera {

// outputs = weights · inputs + biases; ReLU after each layer but the last.
struct DenseLayer {
  uint32_t inputs = 0, outputs = 0;
  std::vector<float> weights;  // [outputs][inputs]
  std::vector<float> biases;   // [outputs]

  bool operator==(const DenseLayer&) const = default;
};

inline constexpr uint32_t kMostLayers = 8, kMostLayerWidth = 256;  // of a network
inline constexpr uint32_t kMostNetworkVectors = 4096;              // of four numbers, as shaders take them

// Of four numbers, that a layer takes in a shader: biases, and weights for each input.
inline uint32_t networkVectors(uint32_t inputs, uint32_t outputs) {
  return (outputs + 3) / 4 * (1 + inputs);
}

// What a network takes in memory.
inline uint64_t bytesInMemory(const std::vector<DenseLayer>& network) {
  uint64_t bytes = 0;
  for (const DenseLayer& layer : network) {
    bytes += sizeof(DenseLayer) + sizeof(float) * (layer.weights.size() + layer.biases.size());
  }
  return bytes;
}

}  // namespace tessera

// The layers of a content's small network in memory.
#pragma once

#include <cstdint>
#include <vector>

namespace tessera {

// outputs = weights · inputs + biases; ReLU follows each layer except the last.
struct DenseLayer {
  uint32_t inputs = 0, outputs = 0;
  std::vector<float> weights;  // [outputs][inputs]
  std::vector<float> biases;   // [outputs]

  bool operator==(const DenseLayer&) const = default;
};

inline constexpr uint32_t kMaxLayers = 8, kMaxLayerWidth = 256;  // limits of a network
inline constexpr uint32_t kMaxNetworkVectors =
    4096;  // vectors of four numbers, the unit in which shaders read networks

// Returns how many vectors of four numbers a layer takes in a shader: its biases, and its weights for each input.
inline uint32_t networkVectors(uint32_t inputs, uint32_t outputs) {
  return (outputs + 3) / 4 * (1 + inputs);
}

// Returns the memory of a network in bytes.
inline uint64_t bytesInMemory(const std::vector<DenseLayer>& network) {
  uint64_t bytes = 0;
  for (const DenseLayer& layer : network) {
    bytes += sizeof(DenseLayer) + sizeof(float) * (layer.weights.size() + layer.biases.size());
  }
  return bytes;
}

}  // namespace tessera

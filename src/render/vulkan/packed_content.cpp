#include "render/vulkan/packed_content.h"

#include <algorithm>

namespace tessera {

GpuNetwork addNetwork(const std::vector<DenseLayer>& network, PackedContent& packed) {
  GpuNetwork packedNetwork;
  std::vector<arguments::LayerArguments> layers;
  std::vector<float> weights;
  for (const DenseLayer& layer : network) {
    layers.push_back({layer.inputs, layer.outputs, static_cast<uint32_t>(weights.size()), 0});
    weights.insert(weights.end(), layer.weights.begin(), layer.weights.end());
    weights.insert(weights.end(), layer.biases.begin(), layer.biases.end());
    packedNetwork.maxWidth = std::max({packedNetwork.maxWidth, layer.inputs, layer.outputs});
  }
  packedNetwork.layerCount = static_cast<uint32_t>(layers.size());
  packedNetwork.layers = packed.add(layers);
  packedNetwork.weights = packed.add(weights);
  return packedNetwork;
}

}  // namespace tessera

#include "render/vulkan/packed_content.h"

#include <algorithm>

namespace tessera {

GpuNetwork addNetwork(const std::vector<DenseLayer>& network, PackedContent& packed) {
  GpuNetwork made;
  std::vector<arguments::LayerArguments> layers;
  std::vector<float> weights;
  for (const DenseLayer& layer : network) {
    layers.push_back({layer.inputs, layer.outputs, static_cast<uint32_t>(weights.size()), 0});
    weights.insert(weights.end(), layer.weights.begin(), layer.weights.end());
    weights.insert(weights.end(), layer.biases.begin(), layer.biases.end());
    made.mostWidth = std::max({made.mostWidth, layer.inputs, layer.outputs});
  }
  made.layerCount = static_cast<uint32_t>(layers.size());
  made.layers = packed.add(layers);
  made.weights = packed.add(weights);
  return made;
}

}  // namespace tessera

#include "render/vulkan/gpu_content.h"

#include <algorithm>
#include <cstring>

#include "shaders/render/arguments_draw.h"

namespace tessera {

namespace {

constexpr size_t kAlignment = 8;

// Puts pieces behind one another in one buffer whose address is known when all are there.
class Packed {
 public:
  // → offset
  template <class T>
  size_t add(const std::vector<T>& values) {
    const size_t offset = bytes_.size();
    const auto from = std::as_bytes(std::span(values));
    bytes_.insert(bytes_.end(), from.begin(), from.end());
    bytes_.resize((bytes_.size() + kAlignment - 1) / kAlignment * kAlignment);
    return offset;
  }
  std::vector<std::byte>& bytes() { return bytes_; }

 private:
  std::vector<std::byte> bytes_;
};

}  // namespace

GpuVolumeContent::GpuVolumeContent(std::shared_ptr<GpuStream> stream, const VolumeContent& content)
    : stream_(std::move(stream)) {
  Packed packed;
  std::vector<arguments::VolumePartArguments> parts;
  for (const VolumePart& part : content.parts) {
    arguments::VolumePartArguments made = {};
    for (int a = 0; a < 3; ++a) {
      made.centre[a] = part.centre[a];
      made.scale[a] = part.scale[a];
      made.low[a] = part.low[a];
      made.high[a] = part.high[a];
      made.planeWords[a] = packed.add(part.planeBytes[a]);
    }
    made.texels = static_cast<float>(part.planes);
    made.voxels = static_cast<float>(part.voxels);
    made.contracted = part.contracted;
    made.macroblocks = packed.add(part.macroblocks);
    made.voxelWords = packed.add(part.voxelBytes);
    made.distances = packed.add(part.distances);
    parts.push_back(made);
  }
  std::vector<arguments::LayerArguments> layers;
  std::vector<float> weights;
  for (const DenseLayer& layer : content.network) {
    layers.push_back({layer.inputs, layer.outputs, static_cast<uint32_t>(weights.size()), 0});
    weights.insert(weights.end(), layer.weights.begin(), layer.weights.end());
    weights.insert(weights.end(), layer.biases.begin(), layer.biases.end());
    about_.mostWidth = std::max({about_.mostWidth, layer.inputs, layer.outputs});
  }
  const size_t atLayers = packed.add(layers), atWeights = packed.add(weights);
  const size_t atParts = packed.add(parts);
  memory_ = GpuBuffer(stream_->context(), packed.bytes().size());
  for (arguments::VolumePartArguments& part : parts) {  // offsets become addresses
    for (uint64_t* at : {&part.planeWords[0], &part.planeWords[1], &part.planeWords[2], &part.macroblocks,
                         &part.voxelWords, &part.distances}) {
      *at += memory_.address();
    }
  }
  std::memcpy(packed.bytes().data() + atParts, parts.data(), parts.size() * sizeof(parts[0]));
  stream_->upload(memory_, 0, packed.bytes());
  about_.featureRange = content.featureRange;
  about_.densityRange = content.densityRange;
  about_.stepsPerTexel = static_cast<float>(content.stepsPerTexel);
  about_.parts = static_cast<uint32_t>(parts.size());
  about_.layers = static_cast<uint32_t>(layers.size());
  about_.partsAddress = memory_.address() + atParts;
  about_.layersAddress = memory_.address() + atLayers;
  about_.weightsAddress = memory_.address() + atWeights;
}

}  // namespace tessera

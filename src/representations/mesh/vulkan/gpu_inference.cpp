#include "representations/mesh/vulkan/gpu_inference.h"

#include <algorithm>
#include <utility>

#include "base/check.h"
#include "representations/mesh/content/mesh_encoder.h"
#include "shaders/infer_maps.h"
#include "shaders/representations/mesh/arguments_mesh.h"

namespace tessera {
namespace {

constexpr uint32_t kBlocksPerGroup = 32;  // local_size_x of the kernel
constexpr uint32_t kMaxGroups = 4096;

// Returns the layers of an encoder's network. They have no biases.
std::vector<DenseLayer> denseLayers(const MeshEncoder& encoder) {
  const MlpShape shape = encoder.shape();
  std::vector<DenseLayer> layers;
  size_t next = 0;
  for (int layer = 0; layer < shape.layers(); ++layer) {
    DenseLayer& dense = layers.emplace_back();
    dense.inputs = static_cast<uint32_t>(layer == 0 ? shape.inputs : shape.width);
    dense.outputs = static_cast<uint32_t>(layer == shape.hiddenLayers ? shape.outputs : shape.width);
    dense.biases.resize(dense.outputs);
    for (size_t i = 0; i < size_t{dense.inputs} * dense.outputs; ++i)
      dense.weights.push_back(fromHalf(encoder.weights[next++]));
  }
  CHECK(next == encoder.weights.size());
  return layers;
}

// The offsets in `packed` of an encoder's numbers.
struct PackedEncoder {
  size_t table = 0;
  GpuNetwork network;
};

PackedEncoder packEncoder(const MeshEncoder& encoder, PackedContent& packed) {
  PackedEncoder offsets;
  offsets.table = packed.add(encoder.table);
  offsets.network = addNetwork(denseLayers(encoder), packed);
  return offsets;
}

// Returns the GPU memory of an encoder, as packEncoder needs it.
uint64_t countEncoderBytes(const MeshEncoder& encoder) {
  const MlpShape shape = encoder.shape();
  const auto padded = [](uint64_t bytes) { return (bytes + 15) / 16 * 16; };
  const uint64_t biases = static_cast<uint64_t>(shape.width) * static_cast<uint64_t>(shape.hiddenLayers) +
                          static_cast<uint64_t>(shape.outputs);
  return padded(sizeof(uint16_t) * encoder.table.size()) +
         padded(sizeof(arguments::LayerArguments) * static_cast<uint64_t>(shape.layers())) +
         padded(sizeof(float) * (encoder.weights.size() + biases));
}

arguments::InferMapsArguments inferArguments(const PatchSet& part, const MeshEncoder& encoder) {
  const PatchEncoder& from = *part.encoder;
  arguments::InferMapsArguments all = {};
  all.features = static_cast<uint32_t>(encoder.grid.features);
  all.blocks = part.patches * (part.patchEdge / 4) * (part.patchEdge / 4);
  all.places = from.places;
  all.opacityOffset = encoder.opacityOffset;
  all.opaqueFrom = from.opaqueFrom;
  all.transparentBelow = from.transparentBelow;
  for (size_t axis = 0; axis < 3; ++axis) {
    all.unitOrigin[axis] = static_cast<float>(from.scale[axis] * part.origin[axis] + from.offset[axis]);
    all.unitStep[axis] = static_cast<float>(from.scale[axis] * part.step);
  }
  const HashGrid grid(encoder.grid);
  CHECK(grid.levels.size() <= size_t{TESSERA_MAX_LEVELS});
  all.levelCount = static_cast<uint32_t>(grid.levels.size());
  for (size_t l = 0; l < grid.levels.size(); ++l) {
    const HashGridLevel& level = grid.levels[l];
    all.levels[l] = {
        level.scale, level.resolution, level.entries, level.hashed, static_cast<uint32_t>(level.firstEntry), 0};
  }
  return all;
}

}  // namespace

GpuInference::GpuInference(std::shared_ptr<GpuStream> stream)
    : stream_(std::move(stream)), kernels_(stream_->context()) {}

GpuInference::~GpuInference() {
  while (!encoders_.empty()) evict();
}

void GpuInference::setBudget(uint64_t bytes) {
  budget_ = bytes;
  while (bytes_ > budget_) evict();
}

void GpuInference::evict() {
  bytes_ -= encoders_.back().memory.bytes();
  stream_->deferDestroy(std::move(encoders_.back().memory));
  encoders_.pop_back();
}

const GpuInference::Encoder& GpuInference::ensure(const std::shared_ptr<const SharedEncoder>& source) {
  const auto known =
      std::find_if(encoders_.begin(), encoders_.end(), [&](const Encoder& one) { return one.source == source; });
  if (known != encoders_.end()) {
    encoders_.splice(encoders_.begin(), encoders_, known);
    return encoders_.front();
  }
  PackedContent packed;
  const PackedEncoder offsets = packEncoder(source->encoder, packed);
  CHECK(packed.bytes().size() == countEncoderBytes(source->encoder));
  while (!encoders_.empty() && bytes_ + packed.bytes().size() > budget_) evict();
  Encoder encoder;
  encoder.source = source;
  encoder.memory = stream_->makeBuffer(packed.bytes().size());
  stream_->upload(encoder.memory, 0, packed.bytes());
  const uint64_t base = encoder.memory.address();
  encoder.table = base + offsets.table;
  encoder.layers = base + offsets.network.layers;
  encoder.weights = base + offsets.network.weights;
  encoder.layerCount = offsets.network.layerCount;
  encoder.maxWidth = offsets.network.maxWidth;
  bytes_ += packed.bytes().size();
  encoders_.push_front(std::move(encoder));
  return encoders_.front();
}

bool GpuInference::fits(const MeshContent& content) const {
  return std::all_of(content.encoders.begin(), content.encoders.end(),
                     [this](const auto& encoder) { return countEncoderBytes(encoder->encoder) <= budget_; });
}

void GpuInference::infer(const MeshContent& content, const GpuMeshContent& onGpu) {
  CHECK(fits(content) == true);
  size_t number = 0;
  for (const PatchSet& part : content.parts) {
    if (part.patches == 0) continue;
    const uint64_t address = onGpu.parts[number++].address;
    if (!part.encoder) continue;
    const Encoder& encoder = ensure(content.encoders[part.encoder->resource]);
    arguments::InferMapsArguments all = inferArguments(part, encoder.source->encoder);
    all.part = address;
    all.table = encoder.table;
    all.layers = encoder.layers;
    all.weights = encoder.weights;
    all.layerCount = encoder.layerCount;
    stream_->run(kernels_.get(kInferMapsSpirv, encoder.maxWidth), std::as_bytes(std::span(&all, 1)),
                 {.x = workgroups(all.blocks, kBlocksPerGroup, kMaxGroups)});
  }
}

}  // namespace tessera

// The encoder of a block as scenes hold it: a hash grid and a network in fp16, from which the maps of the block's
// contents are inferred (infer_maps.h). It is a file of its own, which the contents share (docs/tile-format.md, section
// 8).
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/file.h"
#include "compute/hash_grid.h"
#include "compute/mlp.h"
#include "tiles/content.h"

namespace tessera {

inline constexpr const char* kEncoderMimeType = "model/gltf-binary";
inline constexpr uint64_t kMaxTableBytes = uint64_t{256} << 20;

struct MeshEncoder {
  HashGridOptions grid;
  uint32_t width = 64, hiddenLayers = 1;
  float opacityOffset = 0;
  // Numbers in fp16.
  std::vector<uint16_t> table;    // [HashGrid::entries()][features]
  std::vector<uint16_t> weights;  // of the layers one after another, [outputs][inputs], without padding

  MlpShape shape() const;
};

// A resource of contents.
struct SharedEncoder final : Resource {
  explicit SharedEncoder(MeshEncoder from) : encoder(std::move(from)) {}
  uint64_t memoryBytes() const override;

  MeshEncoder encoder;
};

uint16_t toHalf(float value);  // the nearest number of fp16, limited to its largest one
float fromHalf(uint16_t half);

// Calls use(i, j) for each weight of a network: i is its number without padding, j its index in MlpForward::weights.
template <class Use>
void forEachWeight(const MlpShape& shape, const Use& use) {
  size_t number = 0;
  for (int layer = 0; layer < shape.layers(); ++layer) {
    const int inputs = layer == 0 ? shape.inputs : shape.width,
              outputs = layer == shape.hiddenLayers ? shape.outputs : shape.width;
    for (int output = 0; output < outputs; ++output)
      for (int input = 0; input < inputs; ++input)
        use(number++, shape.weightOffset(layer) + static_cast<size_t>(output) * shape.layerInputs(layer) + input);
  }
}

// Returns a human-readable description of the first rule of the format that the encoder violates, or nothing if it
// violates none.
std::optional<std::string> validationError(const MeshEncoder& encoder);

// Throws Error if the table is larger than readers take, which settings can cause; CHECKs that the encoder violates no
// other rule.
Bytes encodeMeshEncoder(const MeshEncoder& encoder);
// Decodes untrusted bytes. Returns nothing, with the reason in `reason`, if the file violates the format or would take
// more memory than the limits allow.
std::optional<MeshEncoder> decodeMeshEncoder(std::span<const std::byte> file, std::string& reason,
                                             const ContentLimits& limits = {});

}  // namespace tessera

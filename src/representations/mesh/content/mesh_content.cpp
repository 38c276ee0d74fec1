#include "representations/mesh/content/mesh_content.h"

#include <algorithm>
#include <cmath>

#include "base/check.h"

namespace tessera {

uint8_t FeatureRange::encode(float value) const {
  if (!(high > low)) return 0;
  return static_cast<uint8_t>(std::clamp((value - low) / (high - low) * 255 + 0.5f, 0.0f, 255.0f));
}

MeshTexel mixTexels(const MeshContent& content, uint32_t patch, float column, float row) {
  const uint32_t edge = content.patchEdge;
  const auto cell = [&](float at) { return std::min(static_cast<uint32_t>(std::max(0.0f, at)), edge - 2); };
  const uint32_t x = cell(column), y = cell(row);
  const float right = std::clamp(column - static_cast<float>(x), 0.0f, 1.0f);
  const float lower = std::clamp(row - static_cast<float>(y), 0.0f, 1.0f);
  const uint8_t* const texels = content.texels.data() + size_t{kMeshNumbers} * edge * edge * patch;
  std::array<float, kMeshNumbers> bytes{};
  for (uint32_t corner = 0; corner < 4; ++corner) {
    const uint32_t dx = corner & 1, dy = corner >> 1;
    const float weight = (dx ? right : 1 - right) * (dy ? lower : 1 - lower);
    const uint8_t* const texel = texels + size_t{kMeshNumbers} * (x + dx + edge * (y + dy));
    for (uint32_t i = 0; i < kMeshNumbers; ++i) bytes[i] += weight * texel[i];
  }
  MeshTexel mixed;
  for (uint32_t i = 0; i < kMeshFeatures; ++i) {
    const FeatureRange& range = content.ranges[i];
    mixed.features[i] = range.low + (range.high - range.low) * (bytes[i] / 255);
  }
  mixed.opacity = bytes[kMeshFeatures] / 255;
  return mixed;
}

void passThroughBc4(MeshContent& content, Bc4Effort effort) {
  const uint32_t edge = content.patchEdge;
  CHECK(edge % 4 == 0u);
  for (uint32_t patch = 0; patch < content.patches(); ++patch) {
    uint8_t* const texels = content.texels.data() + size_t{kMeshNumbers} * edge * edge * patch;
    for (uint32_t number = 0; number < kMeshNumbers; ++number) {
      for (uint32_t y = 0; y < edge; y += 4) {
        for (uint32_t x = 0; x < edge; x += 4) {
          const auto texel = [&](uint32_t i) -> uint8_t& {
            return texels[size_t{kMeshNumbers} * (x + i % 4 + edge * (y + i / 4)) + number];
          };
          Bc4Texels block{};
          for (uint32_t i = 0; i < block.size(); ++i) block[i] = texel(i);
          const std::array<float, 16> decoded = decodeBc4(encodeBc4(block, effort));
          for (uint32_t i = 0; i < block.size(); ++i) texel(i) = static_cast<uint8_t>(decoded[i] + 0.5f);
        }
      }
    }
  }
}

std::array<float, 3> decodeColour(const std::vector<DenseLayer>& decoder,
                                  const std::array<float, kMeshFeatures>& features,
                                  const std::array<float, 16>& harmonics) {
  std::array<float, kMaxLayerWidth> input{}, output{};
  std::copy(features.begin(), features.end(), input.begin());
  std::copy_n(harmonics.begin(), kMeshHarmonics, input.begin() + kMeshFeatures);
  for (size_t l = 0; l < decoder.size(); ++l) {
    const DenseLayer& layer = decoder[l];
    for (uint32_t o = 0; o < layer.outputs; ++o) {
      float sum = layer.biases.empty() ? 0 : layer.biases[o];
      for (uint32_t i = 0; i < layer.inputs; ++i) sum += layer.weights[size_t{o} * layer.inputs + i] * input[i];
      output[o] = l + 1 < decoder.size() ? std::max(0.0f, sum) : sum;
    }
    input = output;
  }
  CHECK(decoder.back().outputs == 3u);
  std::array<float, 3> colour{};
  for (int c = 0; c < 3; ++c) colour[c] = 1 / (1 + std::exp(-input[c]));
  return colour;
}

}  // namespace tessera

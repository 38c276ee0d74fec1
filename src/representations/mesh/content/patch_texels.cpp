#include "representations/mesh/content/patch_texels.h"

#include <algorithm>
#include <cmath>

namespace tessera {

Vec3d texelPosition(const std::array<Vec3d, 4>& corners, bool isPair, double column, double row, uint32_t patchEdge) {
  const double u = column / (patchEdge - 1), v = row / (patchEdge - 1);
  if (u + v <= 1 || !isPair) return corners[0] + u * (corners[1] - corners[0]) + v * (corners[2] - corners[0]);
  return corners[3] + (1 - u) * (corners[2] - corners[3]) + (1 - v) * (corners[1] - corners[3]);
}

MeshTexel averagePlaces(std::span<const float> features, float opacityOffset) {
  MeshTexel texel;
  const float share = static_cast<float>(kMeshFeatures) / static_cast<float>(features.size());
  for (size_t first = 0; first < features.size(); first += kMeshFeatures) {
    for (size_t f = 0; f < kMeshFeatures; ++f) texel.features[f] += share * features[first + f];
    texel.opacity += share / (1 + std::exp(-features[first] - opacityOffset));
  }
  return texel;
}

void allocateTextures(PatchSet& set) {
  for (auto& blocks : set.featureBlocks) blocks.assign(set.textureBlocks() * PatchSet::kBc5Bytes, 0);
  set.opacityBlocks.assign(set.textureBlocks() * PatchSet::kBc4Bytes, 0);
}

void compressPatch(PatchSet& set, uint32_t patch, const uint8_t* texels, Bc4Effort effort) {
  const uint32_t edge = set.patchEdge, across = set.patchesAcross(), blocksAcross = set.textureWidth() / 4;
  for (uint32_t y = 0; y < edge; y += 4) {
    for (uint32_t x = 0; x < edge; x += 4) {
      const size_t block = (patch % across * edge + x) / 4 + size_t{blocksAcross} * ((patch / across * edge + y) / 4);
      for (uint32_t number = 0; number < kTexelNumbers; ++number) {
        Bc4Texels values{};
        for (uint32_t i = 0; i < values.size(); ++i)
          values[i] = texels[size_t{kTexelNumbers} * (x + i % 4 + edge * (y + i / 4)) + number];
        const Bc4Block encoded = encodeBc4(values, effort);
        uint8_t* const to = number < kMeshFeatures
                                ? set.featureBlocks[number / 2].data() + PatchSet::kBc5Bytes * block +
                                      PatchSet::kBc4Bytes * (number % 2)
                                : set.opacityBlocks.data() + PatchSet::kBc4Bytes * block;
        std::copy(encoded.begin(), encoded.end(), to);
      }
    }
  }
}

}  // namespace tessera

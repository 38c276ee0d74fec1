// One content of a `mesh` scene in memory (Gu et al. 2023, UE4-NeRF, section 3.2): triangles in patches of texels, and
// the network that turns the features of a texel, seen from a direction, into a colour.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "tiles/bc4.h"
#include "tiles/dense_layer.h"

namespace tessera {

inline constexpr uint32_t kMeshFeatures = 8;
inline constexpr uint32_t kMeshHarmonics = 9;  // of the direction, inputs of the decoder after the features
inline constexpr uint32_t kMeshNumbers = kMeshFeatures + 1;  // of a texel: the features, and the opacity

// The values that a byte stands for: linear from `low` (0) to `high` (255).
struct FeatureRange {
  float low = 0, high = 1;

  float decode(uint8_t byte) const { return low + (high - low) * (static_cast<float>(byte) / 255); }
  // The nearest byte, clamped to the range.
  uint8_t encode(float value) const;
};

// Patch p is a square of patchEdge² texels. Its corners, vertices 4p to 4p + 3, lie at the centres of its outermost
// texels (0, 0), (T-1, 0), (0, T-1) and (T-1, T-1). Its triangles have the vertices (4p, 4p+1, 4p+2) and
// (4p+3, 4p+2, 4p+1); patches from `pairs` on have the first alone. Texels are mixed bilinearly.
struct MeshContent {
  uint32_t patchEdge = 8;  // T
  uint32_t pairs = 0;
  std::vector<float> vertices;                     // [patches][4][3], scene units
  std::vector<uint8_t> texels;                     // [patches][T][T][kMeshNumbers], rows first; opacity / 255 last
  std::array<FeatureRange, kMeshFeatures> ranges;  // of the features
  std::vector<DenseLayer> decoder;                 // without biases

  uint32_t patches() const { return static_cast<uint32_t>(vertices.size() / 12); }
  uint32_t triangles() const { return patches() + pairs; }
};

struct MeshTexel {
  std::array<float, kMeshFeatures> features{};
  float opacity = 0;
};
// Mixes the texels of a patch at texel coordinates in [0, T-1].
MeshTexel mixTexels(const MeshContent& content, uint32_t patch, float column, float row);

// Replaces the texels by what remains of them after block compression of each of the nine numbers, rounded to 8 bits.
// patchEdge is a multiple of 4.
void passThroughBc4(MeshContent& content, Bc4Effort effort);

// The colour of features seen along a direction, whose evaluateHarmonics() these are: the decoder's output through a
// sigmoid.
std::array<float, 3> decodeColour(const std::vector<DenseLayer>& decoder,
                                  const std::array<float, kMeshFeatures>& features,
                                  const std::array<float, 16>& harmonics);

}  // namespace tessera

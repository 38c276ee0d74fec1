// The texels of patches: where they lie, and how they are written into the textures of a part.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "representations/mesh/content/mesh_content.h"
#include "scene/axes.h"
#include "tiles/bc4.h"

namespace tessera {

inline constexpr uint32_t kTexelNumbers = kMeshFeatures + 1;  // of a texel: the features, and the opacity

// The position in the scene of a texel of a patch, which continues the first triangle's plane where there is no second
// one. `column`, `row`: in units of texels, T - 1 at the last.
Vec3d texelPosition(const std::array<Vec3d, 4>& corners, bool isPair, double column, double row, uint32_t patchEdge);

// The column, or row, of a place in a texel, of which there are `places` along its edge.
inline double placeInTexel(uint32_t texel, uint32_t number, uint32_t places) {
  return texel + (number + 0.5) / places - 0.5;
}

inline float storedOpacity(float opacity, float opaqueFrom, float transparentBelow) {
  return opacity >= opaqueFrom ? 1 : opacity < transparentBelow ? 0 : opacity;
}

// Averages the output of an encoder, [places][kMeshFeatures], at the places of a texel; opacities after the sigmoid.
MeshTexel averagePlaces(std::span<const float> features, float opacityOffset);

// Makes all textures, filled with zeros.
void allocateTextures(PatchSet& set);
// Writes the texels of a patch, [T][T][kTexelNumbers], rows first.
void compressPatch(PatchSet& set, uint32_t patch, const uint8_t* texels, Bc4Effort effort);

}  // namespace tessera

// Patches of texels as they are baked, in 8 bits and in the frame of a part of a trained mesh, and their compression to
// what a content holds.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "base/image.h"
#include "representations/mesh/content/patch_texels.h"

namespace tessera {

// The layout of patches is that of PatchSet, the pairs first.
struct BakedPatches {
  static constexpr uint32_t kNumbers = kTexelNumbers;

  uint32_t patchEdge = 8;  // T
  uint32_t pairs = 0;
  std::vector<double> vertices;                    // [patches][4][3], units of the part
  std::vector<float> directions;                   // [patches][3], in which rays see them on average, of length 1
  std::vector<uint8_t> texels;                     // [patches][T][T][kNumbers], rows first; opacity / 255 last. May be
                                                   // empty
  std::vector<uint8_t> baseColours;                // [patches][T][T][3], without dependence on the view; may be empty
  std::array<FeatureRange, kMeshFeatures> ranges;  // of the features
  std::vector<DenseLayer> decoder;

  uint32_t patches() const { return static_cast<uint32_t>(vertices.size() / 12); }
  uint32_t triangles() const { return patches() + pairs; }
  Vec3d corner(uint32_t patch, uint32_t number) const;
  Vec3d centre(uint32_t patch) const;  // of the corners that have a meaning
  Vec3d direction(uint32_t patch) const;
};

// Mixes the texels of a patch at a column and a row in [0, T-1].
MeshTexel mixTexels(const BakedPatches& patches, uint32_t patch, float column, float row);

// Replaces the texels by what remains of them after block compression of each of the nine numbers, rounded to 8 bits.
// patchEdge is a multiple of 4.
void passThroughBc4(BakedPatches& patches, Bc4Effort effort);

// Maps the frame of a part to that of a scene, which has the same axes: scale · x + translation.
struct SceneFromPart {
  double scale = 1;
  Vec3d translation = Vec3d::Zero();

  Vec3d operator*(const Vec3d& x) const { return scale * x + translation; }
};

// Arranges the patches with the given numbers, in this order, as a part without textures; pairs must come first.
// Vertices are rounded to a lattice whose step is a power of two, so that sets with equal steps agree where they meet.
// CHECKs that there are at most maxPatches().
PatchSet arrangePatches(const BakedPatches& patches, std::span<const uint32_t> numbers,
                        const SceneFromPart& sceneFromPart);
// Likewise, with the texels of the patches.
PatchSet compressPatches(const BakedPatches& patches, std::span<const uint32_t> numbers,
                         const SceneFromPart& sceneFromPart, Bc4Effort effort);
// Returns the base colours and opacities of the same patches in the layout of the textures of the set: four channels.
ImageU8 makeBaseColourTexture(const BakedPatches& patches, std::span<const uint32_t> numbers, const PatchSet& set);

}  // namespace tessera

// What ray-marched contents have in common in memory: where their parts stand in the scene, and macroblocks of texels.
// docs/tile-format.md is normative.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

namespace tessera {

// Scene units: those of tileset.json's extension, where half a finest block's edge is 1. Local coordinates are q = (x -
// centre) / scale per axis. A bounded part's domain is [-1,1]³ and holds q; a contracted one's is [-2,2]³ and holds
// scene/contraction.h of q. With h half the domain's size, texel i of R along an axis lies at -h + 2h (i + ½) / R.
struct ContentPart {
  static constexpr uint32_t kMacroblock = 8;  // texels along an edge; stored with one more at the upper end (the apron)
  static constexpr uint32_t kStoredEdge = 9;  // kMacroblock + 1
  static constexpr uint32_t kStoredTexels = kStoredEdge * kStoredEdge * kStoredEdge;
  static constexpr uint32_t kEmpty = 0xffffffffu;

  std::array<float, 3> centre = {0, 0, 0}, scale = {1, 1, 1};
  bool contracted = false;
  // What it owns, scene units. The surround owns all that lies outside the scene's box, and is seen behind it only.
  std::array<float, 3> low = {-1, -1, -1}, high = {1, 1, 1};
  bool surround = false;

  // [(texels along an axis / 8)³], x fastest: the number of a macroblock among those stored, or kEmpty. Macroblock b
  // holds the texels 8b to 8b + 8 along each axis (the last clamped to the grid), so that a sample whose lower texel is
  // in it finds its upper ones too.
  std::vector<uint32_t> macroblocks;

  float halfDomain() const { return contracted ? 2.0f : 1.0f; }
};

inline constexpr uint32_t kMostStored = 606 * 606;  // macroblocks in a picture of 16383 pixels a side
inline constexpr float kFarthestInScene = 1e7f;     // scene units

}  // namespace tessera

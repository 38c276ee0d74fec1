// The parts of ray-marched contents in memory: their placement in the scene and their macroblocks of texels.
// docs/tile-format.md is normative.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

namespace tessera {

// Lengths are in scene units (tileset.json's extension), where half the edge of a finest block is 1. Local coordinates
// are q = (x - centre) / scale, per axis. The domain of a bounded part is [-1,1]³ and contains q; that of a contracted
// part is [-2,2]³ and contains the contraction of q (scene/contraction.h). With h half the width of the domain, the
// centre of texel i of R along an axis is at -h + 2h (i + ½) / R.
struct ContentPart {
  static constexpr uint32_t kMacroblock = 8;  // texels along an edge, without the apron: one more at the upper end
  static constexpr uint32_t kStoredEdge = 9;  // kMacroblock + 1
  static constexpr uint32_t kStoredTexels = kStoredEdge * kStoredEdge * kStoredEdge;
  static constexpr uint32_t kEmpty = 0xffffffffu;

  std::array<float, 3> centre = {0, 0, 0}, scale = {1, 1, 1};
  bool contracted = false;
  // The region that the part owns, scene units. The background block owns everything outside the scene's box, and is
  // visible only behind the box.
  std::array<float, 3> low = {-1, -1, -1}, high = {1, 1, 1};
  bool backgroundBlock = false;

  // [(texels along an axis / 8)³], x fastest: the index of each macroblock among those stored, or kEmpty. Macroblock b
  // stores texels 8b to 8b + 8 along each axis (clamped to the grid in the last one), so that a sample whose lower
  // texel lies in it finds its upper texels there too.
  std::vector<uint32_t> macroblocks;

  float halfDomain() const { return contracted ? 2.0f : 1.0f; }
};

inline constexpr uint32_t kMaxStored = 606 * 606;  // macroblocks that fit in a picture of 16383² pixels
inline constexpr float kFarthestInScene = 1e7f;    // scene units

}  // namespace tessera

// Bakes a part of a trained mesh: the triangles that extraction keeps, and the output of the encoder at their texels.
#pragma once

#include "representations/mesh/bake/baked_patches.h"
#include "representations/mesh/train/extraction.h"

namespace tessera {

struct MeshBakeSettings {
  uint32_t patchEdge = 8;  // texels along the edge of a patch
  float opaqueFrom = StoredOpacity::kOpaqueFrom, transparentBelow = StoredOpacity::kTransparentBelow;
  bool baseColours = false;    // for an ordinary mesh: colours as the training photos see them on average
  uint32_t placesPerEdge = 0;  // of a texel; 0: as placesPerEdge() says
  bool texels = true;          // may be false without baseColours: no texels, but their ranges
};

// The number of places along an edge of a texel of a level. A texel of a coarse level is the mean of the encoder's
// output at several places in it, because single places alias.
uint32_t placesPerEdge(uint32_t level);

inline constexpr uint32_t kMaxPlacesPerEdge = 4;

// Bakes the given faces of a level.
BakedPatches bakePatches(MeshModel& model, uint32_t level, const FaceSet& faces, const MeshBakeSettings& settings);

}  // namespace tessera

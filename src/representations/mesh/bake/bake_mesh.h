// Bakes a part of a trained mesh: the triangles that extraction keeps, and the output of the encoder at their texels.
#pragma once

#include "representations/mesh/content/mesh_content.h"
#include "representations/mesh/train/extraction.h"

namespace tessera {

struct MeshBakeSettings {
  uint32_t patchEdge = 8;          // texels along the edge of a patch
  float opaqueFrom = 0.8f;         // from this opacity on, texels are stored as opaque
  float transparentBelow = 0.02f;  // below, as transparent
};

// Bakes the given faces of a level. Vertices are in the frame of the part.
MeshContent bakeMeshContent(MeshModel& model, uint32_t level, const FaceSet& faces, const MeshBakeSettings& settings);

}  // namespace tessera

// The texels of the triangles that extraction keeps, on a device, as a renderer will read them: for the final stage of
// training.
#pragma once

#include <functional>

#include "representations/mesh/train/mesh_model.h"
#include "representations/mesh/train/mesh_patches.h"

namespace tessera {

class TexelAtlas {
 public:
  // The vertices of the level must not move from now on. `faces`: of the level, also those in the margin of a block,
  // which contents do not hold but rays beside its walls need.
  TexelAtlas(MeshModel& model, uint32_t level, const FaceSet& faces, uint32_t patchEdge);

  uint32_t patchEdge() const { return patchEdge_; }
  uint32_t texels() const { return texels_; }
  Slice<const uint32_t> patchOfFace() const { return patchOfFace_.all(); }   // PatchTexels::patchOfFace
  Slice<const float> cornerFactors() const { return cornerFactors_.all(); }  // PatchTexels::cornerFactors
  Matrix<const float> positions() const { return Matrix<const float>(positions_.all(), 3); }  // in the field

  // Returns the encoder's output at all texels, [texels][kFeatures].
  std::vector<float> encodeTexels(MeshModel& model) const;
  // Returns the ranges of the features of all visible texels, [kFeatures][2].
  std::vector<float> findRanges(MeshModel& model) const;

 private:
  // Calls use(number of the first texel, features) for some texels at a time, in order.
  void forEachOutput(MeshModel& model, const std::function<void(uint32_t, const std::vector<float>&)>& use) const;
  void addPatch(const OctahedraDomain& domain, const TriangleList& list, const TrianglePatch& patch,
                std::vector<uint32_t>& patchOfFace, std::vector<float>& factors, std::vector<float>& positions);

  uint32_t patchEdge_, texels_ = 0;
  std::vector<bool> pairs_;  // [patches]: whether a patch has two triangles
  Array<uint32_t> patchOfFace_;
  Array<float> cornerFactors_, positions_;
};

}  // namespace tessera

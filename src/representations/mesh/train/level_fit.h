// Makes a coarse level of detail from the finest one: moves its vertices to the surfaces, and determines the faces that
// show the same as they do, and their texels. The paper trains the vertices of coarse levels instead, and evaluates the
// field at their triangles, which lie beside the surfaces that it was trained on.
#pragma once

#include "representations/mesh/train/extraction.h"
#include "representations/mesh/train/mesh_patches.h"

namespace tessera {

// Returns the displacements of a block's vertices, [cells][3] in edges of a cell: in each cell of `grid` that the
// triangles cross, the point with the least sum of squared distances from their planes, weighted by area, and slightly
// drawn to the middle of the triangles' pieces in the cell (Ju et al. 2002, "Dual Contouring of Hermite Data"); in all
// others `displacements`.
std::vector<float> fitVertices(const TriangleList& surface, const OctahedraGrid& grid,
                               std::vector<float> displacements);

// What is known of a texel: nothing; its features; or that rays pass it, which says nothing about those beside it.
enum class KnownTexel : uint8_t { unseen, seen, passed };
// Gives the unseen texels of patches, [patches][edge][edge][kFeatures], the mean of their seen neighbours in the patch,
// and then those beside these, and so on. Patches of which no texel is seen remain as they are.
void fillPatches(uint32_t edge, std::vector<KnownTexel> known, std::vector<float>& texels);

struct FittedLevel {
  FaceSet faces;
  std::vector<float> texels;  // [TexelAtlas::texels()][MeshField::kFeatures]
};

// Fits a coarse level of a block to the finest level, whose faces must be fixed (MeshModel::atlas). Rays of photos and
// parallel rays are followed to the surfaces of the finest level, and from there to the nearest face of the coarse
// level, up to a cell away. Texels get the mean of the features that rays see through them, and opacities that
// decrease with the share of rays that pass them on the way to another face; texels without rays get those of their
// neighbours, or the encoder's output in patches without rays. `tiles`: as for extractFaces. Throws Error if a mask
// cannot be read.
FittedLevel fitLevel(MeshModel& model, uint32_t level, const Capture& capture, const std::vector<TileShares>* tiles,
                     const ExtractionSettings& settings);

}  // namespace tessera

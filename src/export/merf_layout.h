// The layout of one contracted part of a content in the files of MERF (Reiser et al. 2023), which its public web viewer
// reads: google-research, folder merf/, webviewer/index.js (loading), fragment.glsl (lookups), viewdependency.js and
// viewdependency.glsl (network); they are written by internal/export.py. From these sources:
//
// Axes. The viewer's space g is y-up; its grids have axis a of g along axis a of a texture, index 0 at -2: texel i of R
// lies at -2 + (i + ½) 4 / R (fragment.glsl, posSparseGrid and posTriplaneGrid). MERF trains in a z-up world w. The
// viewer gives its network the direction w = (-g0, g2, g1) (index.js, worldspaceROpengl), and training lays its grids
// out to match: x mirrored, y and z swapped (grid_utils.py). All this is a rotation. Ours is another one,
//
//   g = (q1, q2, q0), that is w = (-q1, q0, q2), of local coordinates q: a quarter turn about the vertical,
//
// under which no axis is mirrored. So our macroblocks are MERF's data blocks, byte by byte; with a mirrored axis,
// MERF's blocks would begin one voxel beside ours, and their aprons would need voxels that a scene need not store. The
// network sees rotated directions, so the weights of its direction inputs are rotated back (merfNetwork).
//
// Images. Rows of a PNG are uploaded from the top as rows of a texture (index.js): column s, row t.
//   plane a      s and t are the axes of g other than a, in their order (fragment.glsl, planeUv)
//   slice k      of the atlas: s along axis 0, t along axis 1, k along axis 2
//   grids        of n³ cells, x fastest: n wide and n² high
#pragma once

#include <array>
#include <vector>

#include "base/image.h"
#include "representations/volume/content/volume_content.h"

namespace tessera {

// Four attributes of a texel in the channels of an RGBA image.
struct MerfPicture {
  const char* name;  // part of the file names
  std::array<uint32_t, 4> attributes;
};
inline constexpr MerfPicture kMerfPictures[] = {{"rgb_and_density", {1, 2, 3, 0}}, {"features", {4, 5, 6, 7}}};

// The edge length of a cell in plane texels, for each occupancy grid that the viewer loads.
inline constexpr uint32_t kMerfOccupancyFactors[] = {8, 16, 32, 64, 128};

// Returns the size of the atlas in macroblocks along its axes: the smallest that holds `stored`, then the one with the
// fewest slices; the first axis is the longest. A texture is at most 2048 texels long, and 255 stands for "empty"
// (baking.py). `stored` is at least 1.
std::array<uint32_t, 3> merfAtlas(uint32_t stored);

ImageU8 merfPlane(const VolumePart& part, int plane, const MerfPicture& picture);
// `slice` must be below 9 atlas[2].
ImageU8 merfAtlasSlice(const VolumePart& part, const std::array<uint32_t, 3>& atlas, uint32_t slice,
                       const MerfPicture& picture);
// RGB: the position of each macroblock of the grid in the atlas, or 255, 255, 255.
ImageU8 merfBlockIndices(const VolumePart& part, const std::array<uint32_t, 3>& atlas);
// RGBA: all channels are 1 in cells that may contain something, otherwise 0; ⌈planes / factor⌉ cells along an edge.
ImageU8 merfOccupancy(const VolumePart& part, uint32_t factor);

// Returns the three layers 34 → 16 → 16 → 3 of a content for the viewer's directions, [inputs][outputs] each. The first
// layer has two additional inputs of weight 0: the viewer pads widths to multiples of 4, and if it has to pad the
// inputs, it loses the layer's biases (viewdependency.js).
struct MerfLayer {
  std::vector<std::vector<float>> weights;
  std::vector<float> biases;
};
std::array<MerfLayer, 3> merfNetwork(const std::vector<DenseLayer>& network);

}  // namespace tessera

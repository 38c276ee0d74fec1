// The virtual grid (MERF, section 4.2; City-on-Web, section 4.2): a field is evaluated only at the texels of a voxel
// grid and of three planes, and samples are interpolated from them, so that training sees exactly the data that a
// renderer will read.
#pragma once

#include <array>

#include "compute/memory.h"
#include "compute/operation.h"

namespace tessera {

// The virtual grid of one block; positions of samples and texels are in [0,1]³ over its domain. Texel i of R lies at
// (i + ½) / R. A sample at p has the lookup coordinate u = p R - ½ (exact, in double) and the texels floor(u) and
// floor(u) + 1, each clamped to [0, R - 1].
//   voxels      a sample reads 8 texels of voxels³
//   planes      plane a spans the two other axes b < c, and a sample reads 4 texels of planes²; the coordinate of these
//               texels along a is ½ / planes. There are no planes if `planes` is 0
// The index of voxel (x, y, z) is x + V (y + V z), and that of texel (b, c) of plane a is V³ + a P² + b + P c.
struct VirtualGrid {
  uint32_t voxels = 128, planes = 512;
  bool quantise = true;     // quantises attributes to bytes, with a straight-through gradient
  bool shareTexels = true;  // evaluates each distinct texel of a batch once, instead of each corner of each sample
  float featureRange = 7, densityRange = 14;

  static constexpr uint32_t kAttributes = 8;  // density, diffuse r g b, 4 features
  static constexpr uint32_t kCorners = 20;    // 8 of voxels, then 4 of each of the planes 0, 1 and 2
  static constexpr float kCulled = -1e30f;    // log density of a sample that a renderer would cull

  uint32_t sources() const { return planes > 0 ? 4 : 1; }
  uint32_t corners() const { return planes > 0 ? kCorners : 8; }
  uint32_t texels() const { return voxels * voxels * voxels + 3 * planes * planes; }
  uint32_t words() const { return (texels() + 31) / 32; }
  uint32_t planeTexel(int plane, uint32_t b, uint32_t c) const;
  std::array<float, 3> texelPosition(uint32_t texel) const;
};

// Finds the texels that a batch needs, block by block and ordered by index. With shareTexels off, these are all corners
// of all samples (8 of voxels, then 4 of each plane, the lower neighbour along the first axis first), in row
// corners() · sample + corner; marks and ranks are not used, and firstTexel is zero except for firstTexel[blocks], the
// number of corners.
struct DistinctTexels {
  const VirtualGrid& grid;
  uint32_t blocks = 1;
  Count samples;
  Slice<const uint32_t> blockOfSample;  // [samples]
  Slice<const float> positions;         // [samples][3]
  uint32_t texelCapacity = 0;
  Slice<uint32_t> marks;        // [blocks][words]: bit t of a block is set if its texel t is needed
  Slice<uint32_t> ranks;        // [blocks][words]: the row of the first needed texel in that word or after it
  Slice<uint32_t> firstTexel;   // [blocks + 1], rows; not limited by the capacity
  Slice<float> texelPositions;  // [texelCapacity][3]; rows beyond the capacity are left out
};
TESSERA_OPERATION(DistinctTexels);

// Interpolates samples from the texels of voxels and planes. Each attribute is Σ over corners of weight · dequantised
// value (features -7 + 14 q, density -14 + 28 q, q = floor(255 a + ½) / 255 in double), summed over the four sources
// (voxels and three planes). Then log density = min(sum - 1, 15) and colours = sigmoid(sum). Texels beyond the capacity
// count as q = ½. With minAlpha > 0, a sample with 1 - exp(-σ · runtimeStep) < minAlpha gets the log density kCulled,
// because renderers cull it too.
struct VirtualGridForward {
  const VirtualGrid& grid;
  Count samples;
  Slice<const uint32_t> blockOfSample;
  Slice<const float> positions;
  Slice<const uint32_t> marks, ranks;  // from DistinctTexels; not used with shareTexels off
  Count texels;                        // from DistinctTexels: the counter is its firstTexel[blocks]
  Slice<const float> attributes;       // [texels][8], in [0,1]
  float minAlpha = 0;
  Slice<const float> runtimeSteps;  // [samples]; read only with minAlpha
  Slice<float> logDensities;        // [samples]
  Slice<float> colours;             // [samples][7]: diffuse, features
};
TESSERA_OPERATION(VirtualGridForward);

// Overwrites attributeGradients in all rows below the count of texels. Rounding passes gradients straight through;
// culled samples have no gradient, and neither has a log density that is clamped to 15.
struct VirtualGridBackward {
  const VirtualGrid& grid;
  uint32_t blocks = 1;
  Count samples;
  Slice<const uint32_t> blockOfSample;
  Slice<const float> positions;
  Slice<const uint32_t> marks, ranks, firstTexel;
  Count texels;
  Slice<const float> logDensities, colours;                 // from VirtualGridForward
  Slice<const float> logDensityGradients, colourGradients;  // [samples], [samples][7]
  Slice<float> attributeGradients;                          // [texels][8]
};
TESSERA_OPERATION(VirtualGridBackward);

}  // namespace tessera

// The virtual grid (MERF, section 4.2; City-on-Web, section 4.2): a field is only ever asked at the texels of a voxel
// grid and of three planes, and a sample is interpolated from them, so that training sees exactly what a renderer will
// read.
#pragma once

#include <array>

#include "compute/memory.h"
#include "compute/operation.h"

namespace tessera {

// Of one block; positions and texels in [0,1]³ of its domain. Texel i of R lies at (i + ½) / R; a sample at p has
// lookup coordinate u = p R - ½ (exact, in double), texels floor(u) and floor(u) + 1, each clamped to [0, R - 1].
//   voxels      8 texels of voxels³
//   planes      (0: there are none) plane a holds the two other axes b < c: 4 texels of planes²; there the coordinate
//   along a is ½ / planes
// Numbers of texels: voxel (x, y, z) is x + V (y + V z); plane a's texel (b, c) is V³ + a P² + b + P c.
struct VirtualGrid {
  uint32_t voxels = 128, planes = 512;
  bool quantise = true;     // to bytes, with a straight-through gradient
  bool shareTexels = true;  // each distinct texel of a batch is evaluated once; else each corner of each sample
  float featureRange = 7, densityRange = 14;

  static constexpr uint32_t kAttributes = 8;  // density, diffuse r g b, 4 features
  static constexpr uint32_t kCorners = 20;    // 8 of voxels, then 4 of planes 0, 1, 2
  static constexpr float kCulled = -1e30f;    // log density of a sample that a renderer would not see

  uint32_t sources() const { return planes > 0 ? 4 : 1; }
  uint32_t corners() const { return planes > 0 ? kCorners : 8; }
  uint32_t texels() const { return voxels * voxels * voxels + 3 * planes * planes; }
  uint32_t words() const { return (texels() + 31) / 32; }
  uint32_t planeTexel(int plane, uint32_t b, uint32_t c) const;
  std::array<float, 3> texelPosition(uint32_t texel) const;
};

// Which texels a batch needs, block after block and in order of their numbers. With shareTexels off: every corner of
// every sample (8 of voxels, then 4 of each plane, the lower neighbour of the first axis first), as row corners() ·
// sample + corner; marks and ranks are not used, and firstTexel is all zeros and, at [blocks], the number of corners.
struct DistinctTexels {
  const VirtualGrid& grid;
  uint32_t blocks = 1;
  Count samples;
  Slice<const uint32_t> blockOfSample;  // [samples]
  Slice<const float> positions;         // [samples][3]
  uint32_t texelCapacity = 0;
  Slice<uint32_t> marks;        // [blocks][words]: bit t of a block: texel t is needed
  Slice<uint32_t> ranks;        // [blocks][words]: the row of the first needed texel of that word or after
  Slice<uint32_t> firstTexel;   // [blocks + 1], rows; not limited by the capacity
  Slice<float> texelPositions;  // [texelCapacity][3]; rows beyond the capacity are left out
};
TESSERA_OPERATION(DistinctTexels);

// Samples from the texels of voxels and planes: per attribute Σ over corners of weight · dequantised value (features -7
// + 14 q, density -14 + 28 q, q = floor(255 a + ½) / 255 in double), the four sources (voxels and three planes) summed;
// then log density = min(sum - 1, 15), colours = sigmoid(sum). Texels beyond the capacity count as q = ½. With minAlpha
// > 0 a sample with 1 - exp(-σ · runtimeStep) < minAlpha gets log density kCulled: renderers do not see it either.
struct VirtualGridForward {
  const VirtualGrid& grid;
  Count samples;
  Slice<const uint32_t> blockOfSample;
  Slice<const float> positions;
  Slice<const uint32_t> marks, ranks;  // of DistinctTexels; not with shareTexels off
  Count texels;                        // of DistinctTexels: the counter is its firstTexel[blocks]
  Slice<const float> attributes;       // [texels][8], in [0,1]
  float minAlpha = 0;
  Slice<const float> runtimeSteps;  // [samples]; with minAlpha
  Slice<float> logDensities;        // [samples]
  Slice<float> colours;             // [samples][7]: diffuse, features
};
TESSERA_OPERATION(VirtualGridForward);

// Overwrites attributeGradients of all rows below the count of texels. Rounding is passed straight
// through; culled samples pass nothing, nor does the density where it is held at 15.
struct VirtualGridBackward {
  const VirtualGrid& grid;
  uint32_t blocks = 1;
  Count samples;
  Slice<const uint32_t> blockOfSample;
  Slice<const float> positions;
  Slice<const uint32_t> marks, ranks, firstTexel;
  Count texels;
  Slice<const float> logDensities, colours;                 // as forward wrote them
  Slice<const float> logDensityGradients, colourGradients;  // [samples], [samples][7]
  Slice<float> attributeGradients;                          // [texels][8]
};
TESSERA_OPERATION(VirtualGridBackward);

}  // namespace tessera

// Samples along rays through blocks, with the step of a real-time renderer (NGP-RT, section 3 of the supplement): the
// step has a constant length in the domain of a block, and only occupied cells are sampled.
#pragma once

#include "compute/blocks.h"
#include "compute/operation.h"

namespace tessera {

// Each piece of a ray (compute/block_path.h) is cut into intervals at lengths (i + jitter) · step from its beginning,
// i = 0, 1, …; the first and the last interval may be shorter. Intervals are numbered over all pieces of the ray. A
// sample lies at half the length of its interval; its cell is floor(position · cells) per axis, clamped. Computed in
// double. Samples are created only in occupied cells, and never in a block without a slot. A ray ends before the first
// interval that begins at or beyond `farOfRay`; the step of the interval before it is cut off there, but its middle is
// not moved.
//
// Marching in rounds and rays that do not fit the capacity work as in MarchRays.
struct MarchBlocks {
  static constexpr uint32_t kThrough = 0xffffffffu;  // nextStep of a ray that has no more samples
  static constexpr double kLongestStep = 1e3;        // scene units; contracted steps far away would be longer

  const BlockSpace& space;
  uint32_t cells = 128;  // occupancy cells per axis of a block; the cube of it is a multiple of 32
  float step = 0.0068f;  // as a fraction of the width of the domain: 2 for a bounded block, 4 for a contracted one
  Count rays;
  uint32_t sampleCapacity = 0;
  uint32_t maximum = 0xffffffffu;  // samples per ray in this round
  float maxOpticalDepth = 0;
  Slice<const float> origins, directions;  // [rays][3]; a ray with direction zero has no samples
  Slice<const float> jitter;               // optional, [rays], in [0,1]; 1 if absent
  Slice<const float> nearOfRay;            // optional, [rays]
  Slice<const float> farOfRay;             // optional, [rays]
  Slice<const uint32_t> slotOfBlock;       // optional, [blocks]
  Slice<const uint32_t> occupancy;         // [slots][cells³ / 32] bits, x fastest, least significant first
  Slice<const float> opticalDepth;         // optional, [rays]: of the samples of earlier rounds
  Slice<uint32_t> nextStep;                // optional, [rays]: see MarchRays::nextStep; counts intervals
  Slice<uint32_t> firstSample;             // [rays + 1]
  Slice<uint32_t> sampleCount;             // [1]
  Slice<uint32_t> finishedRays;            // optional, [1]
  // Per sample, [sampleCapacity]:
  Slice<uint32_t> rayOfSample;
  Slice<uint32_t> slotOfSample;
  Slice<float> positions;  // [..][3], in [0,1] over the block's domain
  Slice<float> distances;  // t of the middle
  Slice<float> steps;      // length in t, at most kLongestStep
  Slice<float> middles;    // length along the ray's pieces, in domain units, up to the middle of the interval
  Slice<float> widths;     // length of the interval in domain units
};
TESSERA_OPERATION(MarchBlocks);

}  // namespace tessera

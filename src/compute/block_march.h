// Samples along rays through blocks in the steps in which a renderer marches (NGP-RT, section 3 of the supplement): of
// one length everywhere in the domain of a block, and only where its occupancy says that something may be.
#pragma once

#include "compute/blocks.h"
#include "compute/operation.h"

namespace tessera {

// The pieces of a ray (compute/block_path.h) are cut, each from its begin on, at lengths (i + jitter) · step, i = 0, 1,
// …: the first interval and the last may be shorter. Intervals are counted over all pieces of the ray. A sample sits
// in the middle of its interval, in length; its cell is floor(position · cells) per axis, clamped. Work in double.
// Only samples whose cell is occupied are made, and none in a block that has no slot. A ray ends with the interval that
// begins at `farOfRay` or behind; the step of the one before is cut off there, its middle stays.
//
// Rounds, and rays that do not fit: as MarchRays.
struct MarchBlocks {
  static constexpr uint32_t kThrough = 0xffffffffu;  // nextStep of a ray that has no more samples
  static constexpr double kLongestStep = 1e3;        // scene units: contracted steps at the end of the world are longer

  const BlockSpace& space;
  uint32_t cells = 128;  // of a block's occupancy, along each axis; its cube is a multiple of 32
  float step = 0.0068f;  // of the width of a domain, which is 2 of a bounded block and 4 of a contracted one
  Count rays;
  uint32_t sampleCapacity = 0;
  uint32_t most = 0xffffffffu;  // samples of a ray in this round
  float mostOpticalDepth = 0;
  Slice<const float> origins, directions;  // [rays][3]; no direction: no samples
  Slice<const float> jitter;               // optional, [rays], in [0,1]; else 1
  Slice<const float> nearOfRay;            // optional, [rays]
  Slice<const float> farOfRay;             // optional, [rays]
  Slice<const uint32_t> slotOfBlock;       // optional, [blocks]
  Slice<const uint32_t> occupancy;         // [slots][cells³ / 32] bits, x fastest, least significant first
  Slice<const float> opticalDepth;         // optional, [rays]: of the samples before
  Slice<uint32_t> nextStep;                // optional, [rays]: as MarchRays::nextStep
  Slice<uint32_t> firstSample;             // [rays + 1]
  Slice<uint32_t> sampleCount;             // [1]
  Slice<uint32_t> finishedRays;            // optional, [1]
  // Per sample, [sampleCapacity]:
  Slice<uint32_t> rayOfSample;
  Slice<uint32_t> slotOfSample;
  Slice<float> positions;  // [..][3], in [0,1] over the block's domain
  Slice<float> distances;  // t of the middle
  Slice<float> steps;      // length in t, at most kLongestStep
  Slice<float> middles;    // length along the ray's pieces up to the middle
  Slice<float> widths;     // of the interval, likewise
};
TESSERA_OPERATION(MarchBlocks);

}  // namespace tessera

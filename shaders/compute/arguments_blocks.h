// Arguments of scenes partitioned into blocks (src/compute/blocks.h, block_march.h).
#ifndef TESSERA_SHADERS_COMPUTE_ARGUMENTS_BLOCKS_H
#define TESSERA_SHADERS_COMPUTE_ARGUMENTS_BLOCKS_H
#include "arguments_march.h"
#define TESSERA_ROWS_OF_SHARE 32  // GroupByBlock

TESSERA_BEGIN_ARGUMENTS

struct BlockSpaceArguments {
  uint columns;
  uint rows;
  float bottom;
  float top;
  float near;
  uint backgroundBlock;  // 0 none, 1 border, 2 own
};
TESSERA_SIZE(BlockSpaceArguments, 24);

struct EnterSceneArguments {
  BlockSpaceArguments space;
  CountArguments rays;
  FloatPointer origins;
  FloatPointer directions;
  FloatPointer jitter;     // optional
  FloatPointer nearOfRay;  // optional
  FloatPointer range;
  FloatPointer fences;
  uint intervals;
  uint unused;
};
TESSERA_SIZE(EnterSceneArguments, 104);

struct BlockSamplesArguments {
  BlockSpaceArguments space;
  CountArguments rays;
  uint intervals;
  uint firstRow;
  uint texels;
  uint unused;
  FloatPointer origins;
  FloatPointer directions;
  FloatPointer range;
  FloatPointer farOfRay;  // optional
  FloatPointer fences;
  UintPointer slotOfBlock;    // optional
  UintPointer groupOfBlock;   // optional
  UintPointer sampleCounts;   // [rays]: counts, then their prefix sums
  UintPointer segmentCounts;  // [rays]: counts, then their prefix sums
  UintPointer firstSample;
  UintPointer rowCount;
  UintPointer blockOfSample;
  FloatPointer positions;
  FloatPointer distances;
  FloatPointer steps;
  FloatPointer middles;       // optional
  FloatPointer widths;        // optional
  FloatPointer runtimeSteps;  // optional
  UintPointer firstSegment;
  UintPointer segmentCount;
  UintPointer firstSampleOfSegment;
  UintPointer groupOfSegment;
  UintPointer rayOfSegment;
};
TESSERA_SIZE(BlockSamplesArguments, 248);

struct BlockPointsArguments {
  BlockSpaceArguments space;
  Bits64 key;
  uint points;
  uint texels;
  uint blockCount;
  uint unused;
  UintPointer blocks;
  UintPointer slotOfBlock;  // optional
  UintPointer blockOfSample;
  FloatPointer positions;
  FloatPointer runtimeSteps;
};
TESSERA_SIZE(BlockPointsArguments, 88);

struct MarchBlocksArguments {
  BlockSpaceArguments space;
  MarchArguments march;
  uint cells;
  float step;
  FloatPointer nearOfRay;   // optional
  UintPointer slotOfBlock;  // optional
  UintPointer slotOfSample;
  FloatPointer middles;
  FloatPointer widths;
};
TESSERA_SIZE(MarchBlocksArguments, 240);

// A stable sort by block: one invocation counts and writes each share of the rows.
struct GroupByBlockArguments {
  CountArguments samples;
  UintPointer blockOfSample;
  UintPointer counts;  // [blocks][shares]: counts, then their prefix sums
  UintPointer firstOfBlock;
  UintPointer source;
  uint blocks;
  uint shares;
};
TESSERA_SIZE(GroupByBlockArguments, 64);

TESSERA_END_ARGUMENTS
#endif

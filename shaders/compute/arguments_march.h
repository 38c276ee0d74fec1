// What marching along rays has in common, in one space or from block to block.
#ifndef TESSERA_SHADERS_COMPUTE_ARGUMENTS_MARCH_H
#define TESSERA_SHADERS_COMPUTE_ARGUMENTS_MARCH_H
#include "arguments.h"
TESSERA_BEGIN_ARGUMENTS

struct MarchArguments {
  CountArguments rays;
  uint most;
  float mostOpticalDepth;
  FloatPointer origins;
  FloatPointer directions;
  FloatPointer jitter;    // optional
  FloatPointer farOfRay;  // optional
  UintPointer occupancy;
  FloatPointer opticalDepth;  // optional
  UintPointer nextStep;       // optional
  UintPointer counts;         // [rays]: of samples, then their running sums
  UintPointer nexts;          // [rays]: of a ray that fits
  UintPointer fitting;        // [1]
  UintPointer firstSample;
  UintPointer sampleCount;
  UintPointer finishedRays;  // optional
  UintPointer rayOfSample;   // optional in one space
  FloatPointer positions;
  FloatPointer distances;
  FloatPointer steps;
};
TESSERA_SIZE(MarchArguments, 168);

TESSERA_END_ARGUMENTS
#endif

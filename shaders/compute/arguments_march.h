// Common arguments of ray marching in one space and from block to block.
#ifndef TESSERA_SHADERS_COMPUTE_ARGUMENTS_MARCH_H
#define TESSERA_SHADERS_COMPUTE_ARGUMENTS_MARCH_H
#include "arguments.h"
TESSERA_BEGIN_ARGUMENTS

struct MarchArguments {
  CountArguments rays;
  uint maximum;
  float maxOpticalDepth;
  FloatPointer origins;
  FloatPointer directions;
  FloatPointer jitter;    // optional
  FloatPointer farOfRay;  // optional
  UintPointer occupancy;
  FloatPointer opticalDepth;  // optional
  UintPointer nextStep;       // optional
  UintPointer counts;         // [rays]: sample counts, then their prefix sums
  UintPointer nexts;          // [rays]: the next step of each ray whose samples fit
  UintPointer fitting;        // [1]
  UintPointer firstSample;
  UintPointer sampleCount;
  UintPointer finishedRays;  // optional
  UintPointer rayOfSample;   // optional for MarchRays
  FloatPointer positions;
  FloatPointer distances;
  FloatPointer steps;
};
TESSERA_SIZE(MarchArguments, 168);

TESSERA_END_ARGUMENTS
#endif

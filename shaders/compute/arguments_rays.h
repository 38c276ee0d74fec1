// Arguments of rays and their samples (src/compute/rays.h, occupancy.h).
#ifndef TESSERA_SHADERS_COMPUTE_ARGUMENTS_RAYS_H
#define TESSERA_SHADERS_COMPUTE_ARGUMENTS_RAYS_H
#include "arguments_march.h"
TESSERA_BEGIN_ARGUMENTS

struct GenerateRaysArguments {
  CountArguments rays;
  UintPointer cameras;  // RayCamera
  UintPointer cameraOfRay;
  FloatPointer pixels;
  FloatPointer origins;
  FloatPointer directions;
};
TESSERA_SIZE(GenerateRaysArguments, 64);

// MarchSpace and the parameters of its step lattice: λ = ln(1 + cone); linear up to distance t_a at index n_a,
// geometric up to t_b at n_b, constant steps beyond.
struct MarchSpaceArguments {
  uint contracted;
  int resolution;
  float far;
  float minStep;
  float maxStep;
  float cone;
  RealArguments firstIndex;  // n(near)
  RealArguments lambda;
  RealArguments linearEnd;
  RealArguments linearDistance;
  RealArguments geometricEnd;
  RealArguments geometricDistance;
};
TESSERA_SIZE(MarchSpaceArguments, 72);

struct MarchRaysArguments {
  MarchSpaceArguments space;
  MarchArguments march;
};
TESSERA_SIZE(MarchRaysArguments, 240);

struct OpticalDepthArguments {
  CountArguments rays;
  UintPointer firstSample;
  MatrixArguments logDensity;
  FloatPointer steps;
  FloatPointer opticalDepth;
};
TESSERA_SIZE(OpticalDepthArguments, 72);

struct CompactSamplesArguments {
  CountArguments rays;
  uint rounds;
  uint sampleCapacity;
  uint keptCapacity;
  float maxOpticalDepth;
  UintPointer firstSample;
  UintPointer nextStep;  // optional
  MatrixArguments logDensity;
  FloatPointer steps;
  UintPointer counts;   // [rays]: numbers of kept samples, then their prefix sums
  UintPointer fitting;  // [1]
  UintPointer keptFirstSample;
  UintPointer keptCount;
  UintPointer finishedRays;  // optional
  UintPointer source;
  UintPointer rayOfSample;
};
TESSERA_SIZE(CompactSamplesArguments, 144);

// Elements are moved as 32-bit words of any type.
struct MoveRowsArguments {
  CountArguments rows;
  UintPointer source;
  MatrixArguments from;
  MatrixArguments to;
};
TESSERA_SIZE(MoveRowsArguments, 80);

struct OccupancyPointsArguments {
  Bits64 key;
  uint points;
  uint first;
  uint uniform_;  // "uniform" is a keyword of GLSL
  uint candidateCount;
  uint resolution;
  uint unused;
  UintPointer candidates;  // optional
  UintPointer occupancy;
  UintPointer cells;
  FloatPointer positions;
};
TESSERA_SIZE(OccupancyPointsArguments, 64);

struct OccupancyUpdateArguments {
  uint contracted;
  uint resolution;
  float minStep;
  float maxStep;
  float cone;
  float decay;
  float threshold;
  uint points;
  uint cellCount;
  uint unused;
  UintPointer cells;
  MatrixArguments logDensity;
  FloatPointer grid;
  UintPointer gridBits;  // the same memory
  UintPointer occupancy;
  FloatPointer partials;  // [workgroups][2]: sum and number of cells that are not negative
  FloatPointer sums;      // [2]
};
TESSERA_SIZE(OccupancyUpdateArguments, 112);

struct OccupancySamplesArguments {
  CountArguments rays;
  uint resolution;
  float offset;
  float minTransmittance;
  uint unused;
  UintPointer firstSample;
  MatrixArguments x;
  FloatPointer positions;
  FloatPointer grid;
  UintPointer gridBits;  // the same memory
};
TESSERA_SIZE(OccupancySamplesArguments, 96);

TESSERA_END_ARGUMENTS
#endif

// Arguments of octahedra grids (src/compute/octahedra.h).
#ifndef TESSERA_SHADERS_COMPUTE_ARGUMENTS_OCTAHEDRA_H
#define TESSERA_SHADERS_COMPUTE_ARGUMENTS_OCTAHEDRA_H
#include "arguments.h"
TESSERA_BEGIN_ARGUMENTS

const uint kMaxReachingFaces = 112;

// Of OctahedraGrid, what differs between the grids of one operation.
struct OctahedraGridArguments {
  float gridFromScene[16];
  float lowest[3];  // within the grid
  float highest[3];
  float positionOffset[3];
  float positionScale;
};

struct TraceOctahedraArguments {
  CountArguments rays;
  uint resolution;
  uint faceCount;  // of reachingFaces(), for cells of each parity
  uint maximum;
  float near;
  uint gridCount;
  float boxInFront[3];
  FloatPointer origins;
  FloatPointer directions;
  FloatPointer farOfRay;  // optional
  FloatPointer displacements;
  UintPointer occupancy;
  UintPointer keptFaces;  // optional
  UintPointer counts;   // [rays]: numbers of hits, then their prefix sums
  UintPointer fitting;  // [1]
  UintPointer firstSample;
  UintPointer sampleCount;
  UintPointer finishedRays;  // optional
  UintPointer rayOfSample;   // optional
  UintPointer hitFaces;
  FloatPointer barycentrics;
  FloatPointer positions;
  FloatPointer distances;
  OctahedraGridArguments grids[6];
  // reachingFaces(): from the lowest bits on, 2 bits each for the octahedron's x + 1, y + 1 and z + 1, 5 bits for the
  // local number, and 5 bits for the cell of each corner, x + 1 + 3 (y + 1) + 9 (z + 1).
  uint faces[2 * 112];
};
TESSERA_SIZE(TraceOctahedraArguments, 1704);

struct OctahedraBackwardArguments {
  CountArguments samples;
  uint resolution;
  float minCosine;
  FloatPointer origins;
  FloatPointer directions;
  FloatPointer displacements;
  UintPointer rayOfSample;
  UintPointer faces;
  FloatPointer barycentrics;
  FloatPointer distances;
  FloatPointer positionGradients;
  FloatPointer distanceGradients;  // optional
  SumPointer displacementGradients;
  OctahedraGridArguments grids[6];
};
TESSERA_SIZE(OctahedraBackwardArguments, 736);

struct MergeOctahedraArguments {
  uint resolution;
  uint points;
  uint listed;
  float offset;
  UintPointer cells;
  MatrixArguments x;
  FloatPointer displacements;
  FloatPointer opacities;
  FloatPointer merged;
};
TESSERA_SIZE(MergeOctahedraArguments, 72);

TESSERA_END_ARGUMENTS
#endif

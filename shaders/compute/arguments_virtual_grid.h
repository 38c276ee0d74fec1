// Arguments of the virtual grid and the lattice (src/compute/virtual_grid.h, lattice.h).
#ifndef TESSERA_SHADERS_COMPUTE_ARGUMENTS_VIRTUAL_GRID_H
#define TESSERA_SHADERS_COMPUTE_ARGUMENTS_VIRTUAL_GRID_H
#include "arguments.h"
TESSERA_BEGIN_ARGUMENTS

struct VirtualGridArguments {
  uint voxels;
  uint planes;
  uint corners;
  uint words;  // of marks per block
  uint quantise;
  uint shareTexels;
  float featureRange;
  float densityRange;
};
TESSERA_SIZE(VirtualGridArguments, 32);

struct DistinctTexelsArguments {
  VirtualGridArguments grid;
  CountArguments samples;
  UintPointer blockOfSample;
  FloatPointer positions;
  UintPointer marks;
  UintPointer ranks;
  UintPointer firstTexel;
  FloatPointer texelPositions;
  uint blocks;
  uint texelCapacity;
};
TESSERA_SIZE(DistinctTexelsArguments, 112);

struct VirtualGridLookupArguments {
  VirtualGridArguments grid;
  CountArguments samples;
  CountArguments texels;
  UintPointer blockOfSample;
  FloatPointer positions;
  UintPointer marks;
  UintPointer ranks;
  FloatPointer attributes;
  FloatPointer runtimeSteps;  // required if minAlpha > 0
  FloatPointer logDensities;
  FloatPointer colours;
  FloatPointer logDensityGradients;
  FloatPointer colourGradients;
  SumPointer attributeGradients;
  float minAlpha;
  uint unused;
};
TESSERA_SIZE(VirtualGridLookupArguments, 176);

struct LatticeArguments {
  VirtualGridArguments grid;
  CountArguments samples;
  CountArguments texels;
  UintPointer blockOfSample;
  FloatPointer positions;
  UintPointer marks;
  UintPointer ranks;
  FloatPointer values;
  MatrixArguments mixed;  // or its gradients
  SumPointer valueGradients;
};
TESSERA_SIZE(LatticeArguments, 152);

// numbers[0 .. rows · columns) = 0
struct ZeroRowsArguments {
  CountArguments rows;
  FloatPointer numbers;
  uint columns;
  uint unused;
};
TESSERA_SIZE(ZeroRowsArguments, 40);

TESSERA_END_ARGUMENTS
#endif

// Arguments of patches of texels (src/compute/patches.h).
#ifndef TESSERA_SHADERS_COMPUTE_ARGUMENTS_PATCHES_H
#define TESSERA_SHADERS_COMPUTE_ARGUMENTS_PATCHES_H
#include "arguments.h"
TESSERA_BEGIN_ARGUMENTS

struct PatchTexelsArguments {
  CountArguments samples;
  UintPointer patchOfFace;
  UintPointer faces;
  FloatPointer barycentrics;
  FloatPointer cornerFactors;  // optional
  UintPointer texels;
  FloatPointer weights;
  uint patchEdge;
  uint unused;
};
TESSERA_SIZE(PatchTexelsArguments, 80);

struct DistinctRowsArguments {
  CountArguments samples;
  UintPointer ids;
  UintPointer marks;
  UintPointer ranks;
  UintPointer rowIds;
  UintPointer rows;
  uint perSample;
  uint idCount;
  uint rowCapacity;
  uint words;  // of marks
};
TESSERA_SIZE(DistinctRowsArguments, 80);

// StoreTexelsForward and StoreTexelsBackward.
struct StoreTexelsArguments {
  CountArguments rows;
  float offset;
  float opaqueFrom;        // forward
  float transparentBelow;  // forward
  uint unused;
  MatrixArguments features;
  FloatPointer ranges;
  MatrixArguments stored;  // or its gradients
  MatrixArguments featureGradients;  // backward
};
TESSERA_SIZE(StoreTexelsArguments, 120);

// MixRowsForward and MixRowsBackward.
struct MixRowsArguments {
  CountArguments samples;
  CountArguments inputRows;
  UintPointer rows;
  FloatPointer weights;
  MatrixArguments source;  // or its gradients
  MatrixArguments mixed;   // or its gradients
  uint perSample;
  uint unused;
};
TESSERA_SIZE(MixRowsArguments, 120);

TESSERA_END_ARGUMENTS
#endif

// Arguments of the fixed encodings (src/compute/encodings.h).
#ifndef TESSERA_SHADERS_COMPUTE_ARGUMENTS_ENCODINGS_H
#define TESSERA_SHADERS_COMPUTE_ARGUMENTS_ENCODINGS_H
#include "arguments.h"
TESSERA_BEGIN_ARGUMENTS

struct SphericalHarmonicsArguments {
  CountArguments samples;
  FloatPointer directions;
  UintPointer rayOfSample;  // optional
  MatrixArguments encoded;  // or its gradients
  FloatPointer directionGradients;
  uint degree;
  uint unused;
};
TESSERA_SIZE(SphericalHarmonicsArguments, 80);

struct FrequencyArguments {
  CountArguments samples;
  FloatPointer inputs;
  MatrixArguments encoded;  // or its gradients
  FloatPointer inputGradients;
  uint dimensions;
  uint frequencies;
};
TESSERA_SIZE(FrequencyArguments, 72);

TESSERA_END_ARGUMENTS
#endif

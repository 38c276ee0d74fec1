// Arguments of Adam (src/compute/adam.h).
#ifndef TESSERA_SHADERS_COMPUTE_ARGUMENTS_ADAM_H
#define TESSERA_SHADERS_COMPUTE_ARGUMENTS_ADAM_H
#include "arguments.h"
TESSERA_BEGIN_ARGUMENTS

struct AdamArguments {
  FloatPointer parameters;
  FloatPointer gradients;
  FloatPointer firstMoments;
  FloatPointer secondMoments;
  UintPointer counts;
  UintPointer rows;              // [2]: if both are equal, nothing is done
  UintPointer overflowCounters;  // [overflowCounterCount]
  uint overflowCounterCount;
  uint capacity;
  uint count;
  uint skipZeroGradients;
  float rate;
  float beta1;
  float beta2;
  float epsilon;
  float l2;
  float bound;
};
TESSERA_SIZE(AdamArguments, 96);

TESSERA_END_ARGUMENTS
#endif

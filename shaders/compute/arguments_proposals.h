// Arguments of proposal sampling (src/compute/proposals.h; the loss is in arguments_losses.h).
#ifndef TESSERA_SHADERS_COMPUTE_ARGUMENTS_PROPOSALS_H
#define TESSERA_SHADERS_COMPUTE_ARGUMENTS_PROPOSALS_H
#include "arguments.h"
TESSERA_BEGIN_ARGUMENTS

struct ResampleFencesArguments {
  CountArguments rays;
  uint before;
  uint after;
  float anneal;
  float uniformFraction;
  FloatPointer fences;
  FloatPointer weights;
  FloatPointer jitter;  // optional
  FloatPointer resampled;
};
TESSERA_SIZE(ResampleFencesArguments, 72);

TESSERA_END_ARGUMENTS
#endif

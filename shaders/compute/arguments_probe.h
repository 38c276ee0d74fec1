// Arguments of the kernels that measure the peak rates of a GPU (src/compute/vulkan/probe.cpp).
#ifndef TESSERA_SHADERS_COMPUTE_ARGUMENTS_PROBE_H
#define TESSERA_SHADERS_COMPUTE_ARGUMENTS_PROBE_H
#include "arguments.h"
TESSERA_BEGIN_ARGUMENTS

struct ProbeArguments {
  UintPointer from;
  UintPointer to;
  uint count;   // number of elements
  uint rounds;  // number of repetitions
};
TESSERA_SIZE(ProbeArguments, 24);

TESSERA_END_ARGUMENTS
#endif

// Arguments of the kernels that find out what a card can do (src/compute/vulkan/probe.cpp).
#ifndef TESSERA_SHADERS_COMPUTE_ARGUMENTS_PROBE_H
#define TESSERA_SHADERS_COMPUTE_ARGUMENTS_PROBE_H
#include "arguments.h"
TESSERA_BEGIN_ARGUMENTS

struct ProbeArguments {
  UintPointer from;
  UintPointer to;
  uint count;   // of what the kernel goes through
  uint rounds;  // how often
};
TESSERA_SIZE(ProbeArguments, 24);

TESSERA_END_ARGUMENTS
#endif

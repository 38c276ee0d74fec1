// Arguments of cube maps (src/compute/cube_map.h).
#ifndef TESSERA_SHADERS_COMPUTE_ARGUMENTS_CUBE_MAP_H
#define TESSERA_SHADERS_COMPUTE_ARGUMENTS_CUBE_MAP_H
#include "arguments.h"
TESSERA_BEGIN_ARGUMENTS

struct CubeMapArguments {
  CountArguments rays;
  FloatPointer directions;
  FloatPointer texels;   // read by the forward pass
  FloatPointer opacity;  // optional, read by the backward pass
  FloatPointer colours;  // or their gradients
  SumPointer texelGradients;
  uint resolution;
  uint unused;
};
TESSERA_SIZE(CubeMapArguments, 72);

TESSERA_END_ARGUMENTS
#endif

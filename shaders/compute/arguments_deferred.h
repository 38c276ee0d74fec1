// Arguments of City-on-Web's deferred networks and blending (src/compute/deferred.h).
#ifndef TESSERA_SHADERS_COMPUTE_ARGUMENTS_DEFERRED_H
#define TESSERA_SHADERS_COMPUTE_ARGUMENTS_DEFERRED_H
#include "arguments.h"
#define TESSERA_SEGMENTS_OF_SHARE 256  // whose weight gradients a workgroup sums
#define TESSERA_DEFERRED_NUMBERS 101   // of a segment: inputs, both hidden layers, gradients of the sums of all three

TESSERA_BEGIN_ARGUMENTS

struct DeferredArguments {
  CountArguments segments;
  FloatPointer composited;
  UintPointer networkOfSegment;
  UintPointer rayOfSegment;
  FloatPointer directions;
  FloatPointer networks;
  FloatPointer specular;  // or its gradients
  FloatPointer compositedGradients;
  SumPointer networkGradients;
  FloatPointer layers;  // [segments][kNumbers of deferred.glsl]: what weight gradients are made of
};
TESSERA_SIZE(DeferredArguments, 96);

struct BlendArguments {
  CountArguments rays;
  UintPointer firstSegment;
  FloatPointer composited;
  FloatPointer specular;
  FloatPointer opacities;
  FloatPointer depths;
  FloatPointer colour;   // or its gradients
  FloatPointer opacity;  // or its gradients, optional
  FloatPointer depth;
  FloatPointer transmittances;  // [segments]: in front of each
  FloatPointer compositedGradients;
  FloatPointer specularGradients;
  FloatPointer opacityGradients;
};
TESSERA_SIZE(BlendArguments, 120);

TESSERA_END_ARGUMENTS
#endif

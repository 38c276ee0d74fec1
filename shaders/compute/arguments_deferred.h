// Arguments of City-on-Web's deferred networks and blending (src/compute/deferred.h).
#ifndef TESSERA_SHADERS_COMPUTE_ARGUMENTS_DEFERRED_H
#define TESSERA_SHADERS_COMPUTE_ARGUMENTS_DEFERRED_H
#include "arguments.h"
#define TESSERA_SEGMENTS_OF_SHARE 256  // segments whose weight gradients one workgroup sums
#define TESSERA_DEFERRED_NUMBERS 101   // per segment: inputs, both hidden layers, gradients of the sums of all three layers

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
  FloatPointer layers;  // [segments][kNumbers of deferred.glsl]: the factors of weight gradients
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
  FloatPointer transmittances;  // [segments]: in front of each segment
  FloatPointer compositedGradients;
  FloatPointer specularGradients;
  FloatPointer opacityGradients;
};
TESSERA_SIZE(BlendArguments, 120);

TESSERA_END_ARGUMENTS
#endif

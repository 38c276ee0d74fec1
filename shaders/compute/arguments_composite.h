// Arguments of volume rendering (src/compute/composite.h).
#ifndef TESSERA_SHADERS_COMPUTE_ARGUMENTS_COMPOSITE_H
#define TESSERA_SHADERS_COMPUTE_ARGUMENTS_COMPOSITE_H
#include "arguments.h"
TESSERA_BEGIN_ARGUMENTS

struct CompositeForwardArguments {
  CountArguments rays;
  uint extinction;  // 0 opacity, 1 density, 2 logarithm of density, 3 logit
  float minTransmittance;
  float offset;
  uint unused;
  UintPointer firstSample;
  MatrixArguments x;
  FloatPointer steps;
  FloatPointer distances;   // optional
  MatrixArguments colours;  // optional
  FloatPointer background;  // optional
  FloatPointer colour;
  FloatPointer opacity;
  FloatPointer depth;  // optional
  FloatPointer weights;
};
TESSERA_SIZE(CompositeForwardArguments, 152);

struct CompositeBackwardArguments {
  CountArguments rays;
  uint extinction;
  float minTransmittance;
  float fullGradientDistance;
  uint addToXGradients;
  float offset;
  uint unused;
  UintPointer firstSample;
  MatrixArguments x;
  FloatPointer steps;
  FloatPointer distances;
  MatrixArguments colours;            // optional
  FloatPointer background;            // optional
  FloatPointer rayColourGradients;    // with colours
  FloatPointer rayOpacityGradients;   // optional
  FloatPointer rayDepthGradients;     // optional
  FloatPointer weightGradients;       // optional
  FloatPointer opacities;             // [samples][2]: opacity, and transmittance in front of the sample
  FloatPointer xGradients;
  MatrixArguments colourGradients;    // optional
};
TESSERA_SIZE(CompositeBackwardArguments, 200);

// OpaqueForward and OpaqueBackward.
struct OpaqueArguments {
  CountArguments rays;
  float threshold;
  float maxOpacity;
  float minOpacity;
  float offset;
  UintPointer firstSample;
  MatrixArguments x;
  MatrixArguments colours;
  FloatPointer colour;
  FloatPointer opacity;             // forward
  FloatPointer rayColourGradients;  // backward
  FloatPointer xGradients;          // backward
  MatrixArguments colourGradients;  // backward
};
TESSERA_SIZE(OpaqueArguments, 152);

TESSERA_END_ARGUMENTS
#endif

// Arguments of NGP-RT's features and colours (src/compute/attention.h).
#ifndef TESSERA_SHADERS_COMPUTE_ARGUMENTS_ATTENTION_H
#define TESSERA_SHADERS_COMPUTE_ARGUMENTS_ATTENTION_H
#include "arguments.h"
TESSERA_BEGIN_ARGUMENTS

struct AttentionArguments {
  CountArguments samples;
  MatrixArguments coarse;
  MatrixArguments fine;
  FloatPointer logits;       // if they do not vary with the position
  MatrixArguments features;  // forward
  // Backward:
  FloatPointer logDensityGradients;
  MatrixArguments colourGradients;
  MatrixArguments coarseGradients;
  MatrixArguments fineGradients;
  SumPointer logitGradients;
};
TESSERA_SIZE(AttentionArguments, 192);

struct ShadeArguments {
  CountArguments rays;
  MatrixArguments diffuse;
  MatrixArguments specular;
  FloatPointer opacity;
  FloatPointer colour;  // or its gradients
  MatrixArguments sumGradients;
  FloatPointer opacityGradients;
};
TESSERA_SIZE(ShadeArguments, 120);

struct AddColumnsArguments {
  CountArguments rows;
  MatrixArguments added;
  MatrixArguments sums;
};
TESSERA_SIZE(AddColumnsArguments, 72);

TESSERA_END_ARGUMENTS
#endif

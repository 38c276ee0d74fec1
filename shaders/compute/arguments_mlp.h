// Arguments of the MLP (src/compute/mlp.h).
#ifndef TESSERA_SHADERS_COMPUTE_ARGUMENTS_MLP_H
#define TESSERA_SHADERS_COMPUTE_ARGUMENTS_MLP_H
#include "arguments.h"
TESSERA_BEGIN_ARGUMENTS

// Sizes are padded to multiples of 16 where they say so; the weights lie as MlpShape says.
struct MlpForwardArguments {
  CountArguments samples;
  MatrixArguments inputs;
  MatrixArguments outputs;
  FloatPointer weights;
  FloatPointer activations;  // optional
  uint paddedInputs;
  uint paddedOutputs;
  uint hiddenLayers;
  uint sigmoidOutput;
};
TESSERA_SIZE(MlpForwardArguments, 104);

struct MlpBackwardArguments {
  CountArguments samples;
  MatrixArguments outputs;
  MatrixArguments outputGradients;
  MatrixArguments inputGradients;  // optional
  FloatPointer weights;
  FloatPointer activations;
  FloatPointer firstOutputGradients;  // optional
  FloatPointer hiddenGradients;       // [hiddenLayers][capacity][width]: before ReLU
  FloatPointer lastGradients;         // [capacity][paddedOutputs]: before the output activation
  uint paddedInputs;
  uint paddedOutputs;
  uint hiddenLayers;
  uint sigmoidOutput;
};
TESSERA_SIZE(MlpBackwardArguments, 152);

// gradients[o][i] += Σ_samples after[sample][o] · before[sample][i]: the weights of one layer.
struct MlpWeightGradientsArguments {
  CountArguments samples;
  MatrixArguments before;  // the layer's input; columns beyond its own read as zero
  FloatPointer after;      // [capacity][rows]: gradient of the layer's sums
  SumPointer gradients;    // [rows][columns]
  uint rows;
  uint columns;
};
TESSERA_SIZE(MlpWeightGradientsArguments, 72);

TESSERA_END_ARGUMENTS
#endif

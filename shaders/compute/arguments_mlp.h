// Arguments of the MLP (src/compute/mlp.h).
#ifndef TESSERA_SHADERS_COMPUTE_ARGUMENTS_MLP_H
#define TESSERA_SHADERS_COMPUTE_ARGUMENTS_MLP_H
#include "arguments.h"
TESSERA_BEGIN_ARGUMENTS

// Sizes named `padded...` are padded to multiples of 16; MlpShape defines the layout of the weights. Numbers and quads
// are fp16 or float, depending on the kernel (number.glsl); quads are aligned to 16 bytes.
struct MlpForwardArguments {
  CountArguments samples;
  MatrixArguments inputs;
  MatrixArguments outputs;
  NumberPointer weights;
  QuadPointer activations;  // optional
  uint paddedInputs;
  uint paddedOutputs;
  uint hiddenLayers;
  uint sigmoidOutput;
};
TESSERA_SIZE(MlpForwardArguments, 104);

// The inputs for the gradients of the output layer's sums.
struct MlpOutputArguments {
  CountArguments samples;
  MatrixArguments values;
  MatrixArguments gradients;
  FloatPointer firstGradients;  // optional
  uint sigmoid;
  uint unused;
};
TESSERA_SIZE(MlpOutputArguments, 88);

struct MlpBackwardArguments {
  MlpOutputArguments last;
  MatrixArguments inputGradients;  // optional
  NumberPointer weights;
  QuadPointer activations;
  QuadPointer hiddenGradients;  // [hiddenLayers][capacity][width]: with respect to the values before ReLU
  NumberPointer lastGradients;  // [capacity][paddedOutputs]: with respect to the values before the output activation
  FloatPointer largest;         // [largestCount], for lossScale
  uint largestCount;            // 0 if gradients are not scaled
  uint paddedInputs;
  uint paddedOutputs;
  uint hiddenLayers;
};
TESSERA_SIZE(MlpBackwardArguments, 168);

struct MlpLargestGradientArguments {
  MlpOutputArguments last;
  FloatPointer largest;  // [workgroups]
};
TESSERA_SIZE(MlpLargestGradientArguments, 96);

struct HalveNumbersArguments {
  FloatPointer numbers;
  NumberPointer halves;
  uint count;
  uint unused;
};
TESSERA_SIZE(HalveNumbersArguments, 24);

// gradients[o][i] += Σ_samples after[sample][o] · x[sample][i], where x is the layer's input: the weight gradients of
// one layer. x is a matrix of floats (the network's input) or activations; columns beyond the matrix read as zero.
struct MlpWeightGradientsArguments {
  CountArguments samples;
  MatrixArguments inputs;     // empty if there are activations
  NumberPointer activations;  // [capacity][columns]
  NumberPointer after;        // [capacity][rows]: scaled gradients of the layer's sums
  SumPointer gradients;       // [rows][columns]
  FloatPointer largest;       // see MlpBackwardArguments
  uint largestCount;
  uint rows;
  uint columns;
  uint unused;
};
TESSERA_SIZE(MlpWeightGradientsArguments, 96);

TESSERA_END_ARGUMENTS
#endif

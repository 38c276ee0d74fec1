// Arguments of the MLP (src/compute/mlp.h).
#ifndef TESSERA_SHADERS_COMPUTE_ARGUMENTS_MLP_H
#define TESSERA_SHADERS_COMPUTE_ARGUMENTS_MLP_H
#include "arguments.h"
TESSERA_BEGIN_ARGUMENTS

// Sizes are padded to multiples of 16 where they say so; the weights lie as MlpShape says. Numbers and quads of them are
// fp16 or float as the kernel is (number.glsl); quads lie at multiples of 16 bytes.
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

// What the gradients of the output layer's sums are made of.
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
  QuadPointer hiddenGradients;  // [hiddenLayers][capacity][width]: before ReLU
  NumberPointer lastGradients;  // [capacity][paddedOutputs]: before the output activation
  FloatPointer largest;         // [largestCount], for lossScale
  uint largestCount;            // 0: nothing is scaled
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

// gradients[o][i] += Σ_samples after[sample][o] · before[sample][i]: the weights of one layer. Its input is a matrix of
// floats (the network's) or activations; columns beyond its own read as zero.
struct MlpWeightGradientsArguments {
  CountArguments samples;
  MatrixArguments inputs;     // empty where there are activations
  NumberPointer activations;  // [capacity][columns]
  NumberPointer after;        // [capacity][rows]: gradient of the layer's sums, scaled
  SumPointer gradients;       // [rows][columns]
  FloatPointer largest;       // as in MlpBackwardArguments
  uint largestCount;
  uint rows;
  uint columns;
  uint unused;
};
TESSERA_SIZE(MlpWeightGradientsArguments, 96);

TESSERA_END_ARGUMENTS
#endif

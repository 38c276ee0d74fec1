// What the host hands to each compute kernel: one truth, read by C++ and GLSL alike. Pointers lie at multiples of 8 and
// so do the sizes of structs: std430 and C++ lay them out the same.
#ifndef TESSERA_SHADERS_COMPUTE_ARGUMENTS_H
#define TESSERA_SHADERS_COMPUTE_ARGUMENTS_H

#ifdef __cplusplus
#include <cstdint>
namespace tessera::arguments {
using uint = uint32_t;
using FloatPointer = uint64_t;   // device addresses; 0 = not wanted
using UintPointer = uint64_t;
using SumPointer = uint64_t;     // floats that several invocations add to
#define TESSERA_SIZE(type, bytes) static_assert(sizeof(type) == bytes)
#else
#define TESSERA_SIZE(type, bytes)
#endif

struct CountArguments {
  UintPointer counter;  // optional
  UintPointer first;    // optional
  uint capacity;
  uint unused;
};
TESSERA_SIZE(CountArguments, 24);

struct MatrixArguments {
  FloatPointer data;
  uint columns;
  uint rowStride;
  uint groupWidth;  // 0: row-major
  uint groupStride;
};
TESSERA_SIZE(MatrixArguments, 24);

#define TESSERA_MAX_LEVELS 32

struct LevelArguments {
  float scale;
  uint resolution;
  uint entries;
  uint hashed;
  uint firstEntry;
  uint unused;
};
TESSERA_SIZE(LevelArguments, 24);

struct HashGridForwardArguments {
  CountArguments samples;
  FloatPointer positions;
  FloatPointer table;
  MatrixArguments encoded;
  LevelArguments levels[TESSERA_MAX_LEVELS];
};
TESSERA_SIZE(HashGridForwardArguments, 64 + 24 * TESSERA_MAX_LEVELS);

struct HashGridBackwardArguments {
  CountArguments samples;
  FloatPointer positions;
  FloatPointer table;
  SumPointer tableGradients;
  FloatPointer positionGradients;
  MatrixArguments encodedGradients;
  uint levelCount;
  uint unused;
  LevelArguments levels[TESSERA_MAX_LEVELS];
};
TESSERA_SIZE(HashGridBackwardArguments, 88 + 24 * TESSERA_MAX_LEVELS);

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

struct AdamArguments {
  FloatPointer parameters;
  FloatPointer gradients;
  FloatPointer firstMoments;
  FloatPointer secondMoments;
  UintPointer counts;
  UintPointer rows;  // 0: none
  uint count;
  uint skipZeroGradients;
  float rate;
  float beta1;
  float beta2;
  float epsilon;
  float l2;
  uint unused;
};
TESSERA_SIZE(AdamArguments, 80);

#ifdef __cplusplus
}  // namespace tessera::arguments
#endif
#undef TESSERA_SIZE
#endif

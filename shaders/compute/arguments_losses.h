// Arguments of losses and exposure (src/compute/losses.h). Each workgroup writes one partial sum of the loss.
#ifndef TESSERA_SHADERS_COMPUTE_ARGUMENTS_LOSSES_H
#define TESSERA_SHADERS_COMPUTE_ARGUMENTS_LOSSES_H
#include "arguments.h"
TESSERA_BEGIN_ARGUMENTS

struct ColourLossArguments {
  CountArguments rays;
  uint kind;  // 0 squared, 1 Huber, 2 Charbonnier
  float parameter;
  float scale;
  uint unused;
  FloatPointer predicted;
  FloatPointer target;
  FloatPointer weights;   // optional
  FloatPointer partials;  // [workgroups][2]
  FloatPointer gradients;
};
TESSERA_SIZE(ColourLossArguments, 80);

// Arguments of losses that are sums over the samples of each ray.
struct RayLossArguments {
  CountArguments rays;
  float scale;
  float tolerance;  // DepthLoss
  uint normalised;  // DistortionLoss
  uint intervals;   // InterlevelLoss
  UintPointer firstSample;
  FloatPointer weights;
  FloatPointer distances;
  FloatPointer steps;          // DistortionLoss
  FloatPointer known;          // DepthLoss
  FloatPointer fences;         // InterlevelLoss
  FloatPointer middles;        // InterlevelLoss
  FloatPointer widths;         // InterlevelLoss
  FloatPointer sampleWeights;  // InterlevelLoss
  FloatPointer partials;       // [workgroups]
  FloatPointer gradients;
};
TESSERA_SIZE(RayLossArguments, 128);

struct S3imArguments {
  CountArguments rays;
  uint patches;
  float scale;
  Bits64 seed;
  FloatPointer predicted;
  FloatPointer target;
  FloatPointer weights;  // optional
  UintPointer orders;     // [patches][capacity]
  FloatPointer partials;  // [workgroups]
  SumPointer gradients;
};
TESSERA_SIZE(S3imArguments, 88);

// Arguments of losses that are sums over single numbers.
struct NumberLossArguments {
  CountArguments numbers;
  float scale;
  uint unused;
  FloatPointer values;
  FloatPointer runtimeSteps;  // SparsityLoss
  FloatPointer partials;      // [workgroups]
  FloatPointer gradients;
};
TESSERA_SIZE(NumberLossArguments, 64);

struct DitherLossArguments {
  CountArguments rays;
  FloatPointer rayWeights;  // optional
  UintPointer firstSample;
  FloatPointer weights;
  MatrixArguments colours;
  FloatPointer colour;
  FloatPointer opacity;
  FloatPointer background;  // optional
  FloatPointer partials;    // [workgroups]
  FloatPointer weightGradients;
  MatrixArguments colourGradients;
  FloatPointer rayColourGradients;
  FloatPointer rayOpacityGradients;  // with a background
  float scale;
  uint unused;
};
TESSERA_SIZE(DitherLossArguments, 160);

struct ExposureArguments {
  CountArguments rays;
  FloatPointer colours;
  FloatPointer opacity;
  FloatPointer background;  // optional
  UintPointer photoOfRay;
  FloatPointer logGains;
  FloatPointer exposed;  // or its gradients
  FloatPointer colourGradients;
  FloatPointer opacityGradients;
  SumPointer logGainGradients;
};
TESSERA_SIZE(ExposureArguments, 96);

TESSERA_END_ARGUMENTS
#endif

// Volume rendering (Max 1995, as used in NeRF): front-to-back compositing, and its gradient by one back-to-front
// recursion that never divides by 1 - opacity.
#pragma once

#include "compute/memory.h"
#include "compute/operation.h"

namespace tessera {

// What a sample's extinction value x means:
//   opacity      α = x
//   density      α = 1 - exp(-x · step)
//   logDensity   α = 1 - exp(-exp(x) · step); the gradient of exp clamps x to [-15, 15]
//   logit        α = 1 / (1 + exp(-x))
enum class Extinction { opacity, density, logDensity, logit };

// Whether α depends on the step.
constexpr bool usesSteps(Extinction extinction) {
  return extinction == Extinction::density || extinction == Extinction::logDensity;
}

// colour = Σ w c + T · background, depth = Σ w t, opacity = 1 - T. A ray stops after the sample that takes T below
// `minTransmittance`: later samples get weight zero, and T keeps its value at that sample. Colours have
// `colours.columns` columns: 3, more if features are composited with them, or none if only weights are needed (neither
// `colours` nor `colour`). Only opacity and weights are always written.
struct CompositeForward {
  Extinction extinction = Extinction::logDensity;
  float minTransmittance = 1e-4f;
  float offset = 0;  // added to x
  Count rays;
  Slice<const uint32_t> firstSample;  // [rays + 1]
  Matrix<const float> x;              // 1 column: opacity, density, log density or logit
  Slice<const float> steps;           // [samples]; read if usesSteps(extinction)
  Slice<const float> distances;       // [samples]; read only if depth is written
  Matrix<const float> colours;        // optional, [samples], 1 to 16 columns
  Slice<const float> background;      // optional, [rays][columns]; black if absent
  Slice<float> colour;                // [rays][columns]; required with colours
  Slice<float> opacity;               // [rays]
  Slice<float> depth;                 // optional, [rays]
  Slice<float> weights;               // [samples]
};
TESSERA_OPERATION(CompositeForward);

// Overwrites xGradients and colourGradients for all samples of the rays; they are zero for samples after the stop. The
// space close to a camera is seen by few photos, but by many of their pixels: without scaling it learns fastest and
// produces floaters. With `fullGradientDistance` d, both gradients of a sample at distance t are scaled by
// min(1, (t/d)²) (Philip and Deschaintre 2023, gradient scaling); they are then no longer the gradients of the loss.
struct CompositeBackward {
  Extinction extinction = Extinction::logDensity;
  float minTransmittance = 1e-4f;
  float offset = 0;
  float fullGradientDistance = 0;
  Count rays;
  Slice<const uint32_t> firstSample;
  Matrix<const float> x;
  Slice<const float> steps;
  Slice<const float> distances;            // read only with rayDepthGradients or fullGradientDistance
  Matrix<const float> colours;             // optional
  Slice<const float> background;           // optional
  Slice<const float> rayColourGradients;   // [rays][columns]; required with colours
  Slice<const float> rayOpacityGradients;  // optional, [rays]
  Slice<const float> rayDepthGradients;    // optional, [rays]
  Slice<const float> weightGradients;      // optional, [samples]: of other functions of the weights (distortion loss)
  bool addToXGradients = false;            // adds to xGradients instead of overwriting them
  Slice<float> xGradients;                 // [samples]
  Matrix<float> colourGradients;           // [samples], as many columns as colours; required with colours
};
TESSERA_OPERATION(CompositeBackward);

// Compositing of the second loss of UE4-NeRF (Gu et al. 2023, equations 4 to 6), which prepares surfaces for
// rasterisers: only samples with α > threshold count, a ray ends after the sample that takes its opacity A = Σ w above
// `maxOpacity`, and its colour is normalised, Σ w c / A. A ray with A < minOpacity, or A = 0, has colour and opacity
// zero, and no gradients. α is 1 / (1 + exp(-x - offset)).
struct OpaqueForward {
  float threshold = 0, minOpacity = 1e-3f;
  float maxOpacity = 0.8f;  // below 1
  float offset = 0;
  Count rays;
  Slice<const uint32_t> firstSample;  // [rays + 1]
  Matrix<const float> x;              // 1 column: logits
  Matrix<const float> colours;        // [samples], 3 columns
  Slice<float> colour;                // [rays][3]
  Slice<float> opacity;               // [rays]: A
};
TESSERA_OPERATION(OpaqueForward);

// Adds to xGradients and colourGradients. There is no gradient through the threshold and the choice of the last sample.
struct OpaqueBackward {
  float threshold = 0, minOpacity = 1e-3f;
  float maxOpacity = 0.8f;  // below 1
  float offset = 0;
  Count rays;
  Slice<const uint32_t> firstSample;
  Matrix<const float> x;
  Matrix<const float> colours;
  Slice<const float> colour;              // from OpaqueForward
  Slice<const float> rayColourGradients;  // [rays][3]
  Slice<float> xGradients;                // [samples]
  Matrix<float> colourGradients;          // [samples], 3 columns
};
TESSERA_OPERATION(OpaqueBackward);

}  // namespace tessera

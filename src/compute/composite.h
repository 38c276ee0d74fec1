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
enum class Extinction { opacity, density, logDensity };

// colour = Σ w c + T · background, depth = Σ w t, opacity = 1 - T. A ray stops after the sample that takes T below
// `minTransmittance`: later samples get weight zero, and T keeps its value at that sample. Colours have
// `colours.columns` columns: 3, more if features are composited with them, or none if only weights are needed (neither
// `colours` nor `colour`). Only opacity and weights are always written.
struct CompositeForward {
  Extinction extinction = Extinction::logDensity;
  float minTransmittance = 1e-4f;
  Count rays;
  Slice<const uint32_t> firstSample;  // [rays + 1]
  Matrix<const float> x;              // 1 column: opacity, density or log density
  Slice<const float> steps;           // [samples]; not read with Extinction::opacity
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

}  // namespace tessera

// Volume rendering (Max 1995; building blocks of NeRF): front to back, with its gradient by one back-to-front recursion
// that never divides by 1 - opacity.
#pragma once

#include "compute/memory.h"
#include "compute/operation.h"

namespace tessera {

// What a sample's extinction value x means:
//   opacity      α = x
//   density      α = 1 - exp(-x · step)
//   logDensity   α = 1 - exp(-exp(x) · step); gradient through exp clamps x to [-15, 15]
enum class Extinction { opacity, density, logDensity };

// colour = Σ w c + T · background, depth = Σ w t, opacity = 1 - T. A ray stops after the sample that takes T below
// `minTransmittance`; later samples get weight zero, and T counts on as it stands there. Colours have `colours.columns`
// columns: 3, or more where features are composited with them, and none where only weights are wanted (no `colours`, no
// `colour`). Only opacity and weights are always written.
struct CompositeForward {
  Extinction extinction = Extinction::logDensity;
  float minTransmittance = 1e-4f;
  Count rays;
  Slice<const uint32_t> firstSample;  // [rays + 1]
  Matrix<const float> x;              // 1 column: opacity, density or log density
  Slice<const float> steps;           // [samples]; not read for opacity
  Slice<const float> distances;       // [samples]; with depth
  Matrix<const float> colours;        // optional, [samples], 1 to 16 columns
  Slice<const float> background;      // optional, [rays][columns]; else black
  Slice<float> colour;                // [rays][columns]; with colours
  Slice<float> opacity;               // [rays]
  Slice<float> depth;                 // optional, [rays]
  Slice<float> weights;               // [samples]
};
TESSERA_OPERATION(CompositeForward);

// Overwrites xGradients, colourGradients (of samples) for all samples of the rays, zero behind the stop. A place near a
// camera is seen by few photos and by many of their pixels: unscaled, it learns fastest and becomes fog. With
// `fullGradientDistance` d both gradients of a sample at distance t are scaled by min(1, (t/d)²) (Philip and
// Deschaintre 2023, gradient scaling); they are no longer those of the loss.
struct CompositeBackward {
  Extinction extinction = Extinction::logDensity;
  float minTransmittance = 1e-4f;
  float fullGradientDistance = 0;
  Count rays;
  Slice<const uint32_t> firstSample;
  Matrix<const float> x;
  Slice<const float> steps;
  Slice<const float> distances;            // read with rayDepthGradients or fullGradientDistance
  Matrix<const float> colours;             // optional
  Slice<const float> background;           // optional
  Slice<const float> rayColourGradients;   // [rays][columns]; with colours
  Slice<const float> rayOpacityGradients;  // optional, [rays]
  Slice<const float> rayDepthGradients;    // optional, [rays]
  Slice<const float> weightGradients;      // optional, [samples]: of any other function of the weights (distortion)
  bool addToXGradients = false;            // instead of overwriting them
  Slice<float> xGradients;                 // [samples]
  Matrix<float> colourGradients;           // [samples], as colours; with colours
};
TESSERA_OPERATION(CompositeBackward);

}  // namespace tessera

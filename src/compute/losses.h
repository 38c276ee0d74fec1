// Losses on rendered rays, with their gradients.
#pragma once

#include "compute/memory.h"

namespace tessera {

//   mse           r²
//   huber         r² / 2δ if |r| ≤ δ, else |r| - δ/2        (instant-ngp's normalisation: slope at most 1)
//   charbonnier   sqrt(r² + ε²)
enum class ColourLossKind { mse, huber, charbonnier };

// Loss = scale · Σ_rays weight · Σ_channels f(predicted - target). Gradient with respect to `predicted`.
struct ColourLoss {
  ColourLossKind kind = ColourLossKind::huber;
  float parameter = 0.1f;  // δ or ε
  float scale = 1;         // usually 1 / (3 · rays)
  Count rays;
  Slice<const float> predicted;  // [rays][3]
  Slice<const float> target;     // [rays][3]
  Slice<const float> weights;    // optional, [rays]: 0 takes a ray out (masks)
  Slice<float> loss;             // [2], overwritten: the loss, and Σ weight · Σ r² (for PSNR)
  Slice<float> gradients;        // [rays][3], overwritten
};

// Distortion (Barron et al. 2022, eq. 15) in O(n) per ray, on normalised positions s = g(t), g(t) = t/2 for t < 1,
// 1 - 1/(2t) beyond (MERF's warp): Σ_ij w_i w_j |s_i - s_j| + Σ_i w_i² Δs_i / 3; intervals [t - step/2, t + step/2],
// s_i their mean in s. Distances increase along a ray. loss[0] = scale · Σ_rays.
struct DistortionLoss {
  float scale = 1;
  Count rays;
  Slice<const uint32_t> firstSample;  // [rays + 1]
  Slice<const float> weights;         // [samples]
  Slice<const float> distances;       // [samples]
  Slice<const float> steps;           // [samples]
  Slice<float> loss;                  // [1], overwritten
  Slice<float> weightGradients;       // [samples], overwritten
};

// Pulls what a ray sees to where structure from motion found a point, at distance D: scale · Σ_rays (1 - Σ_i w_i (1 -
// r_i)), r_i = min(1, max(0, |t_i - D| / D - tolerance)). That is the Wasserstein distance between the ray's weights
// and a surface at D, in shares of D; light from behind the scene, and from twice as far, counts as 1.
struct DepthLoss {
  float scale = 1;
  float tolerance = 0.01f;
  Count rays;
  Slice<const uint32_t> firstSample;  // [rays + 1]
  Slice<const float> weights;         // [samples]
  Slice<const float> distances;       // [samples]
  Slice<const float> known;           // [rays]: D; 0: not known, and no loss
  Slice<float> loss;                  // [1], overwritten
  Slice<float> weightGradients;       // [samples], added to
};

// Per-photo exposure: exposed = colour · 2^(logGain[photo of ray]) + (1 - opacity) · background per channel, in the
// trained colour space. Colours are of the scene alone: what stands behind it is not exposed with it.
struct ExposureForward {
  Count rays;
  Slice<const float> colours;        // [rays][3]
  Slice<const float> opacity;        // [rays]; read only with a background
  Slice<const float> background;     // optional, [rays][3]; else black
  Slice<const uint32_t> photoOfRay;  // [rays]
  Slice<const float> logGains;       // [photos][3]
  Slice<float> exposed;              // [rays][3]
};

// Overwrites colourGradients and opacityGradients, adds to logGainGradients.
struct ExposureBackward {
  Count rays;
  Slice<const float> colours;
  Slice<const float> background;
  Slice<const uint32_t> photoOfRay;
  Slice<const float> logGains;
  Slice<const float> exposedGradients;  // [rays][3]
  Slice<float> colourGradients;         // [rays][3]; may be the same memory as exposedGradients
  Slice<float> opacityGradients;        // [rays]; with a background
  Slice<float> logGainGradients;        // [photos][3]
};

}  // namespace tessera

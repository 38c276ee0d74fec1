// Losses on rendered rays, with their gradients.
#pragma once

#include "compute/memory.h"
#include "compute/operation.h"

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
TESSERA_OPERATION(ColourLoss);

// Distortion (Barron et al. 2022, eq. 15) in O(n) per ray, on normalised positions s = g(t), g(t) = t/2 for t < 1,
// 1 - 1/(2t) beyond (MERF's warp): Σ_ij w_i w_j |s_i - s_j| + Σ_i w_i² Δs_i / 3; intervals [t - step/2, t + step/2],
// s_i their mean in s. Distances increase along a ray. loss[0] = scale · Σ_rays. `normalised`: distances and steps are
// already in s, and nothing is warped.
struct DistortionLoss {
  float scale = 1;
  bool normalised = false;
  Count rays;
  Slice<const uint32_t> firstSample;  // [rays + 1]
  Slice<const float> weights;         // [samples]
  Slice<const float> distances;       // [samples]
  Slice<const float> steps;           // [samples]
  Slice<float> loss;                  // [1], overwritten
  Slice<float> weightGradients;       // [samples], overwritten
};
TESSERA_OPERATION(DistortionLoss);

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
TESSERA_OPERATION(DepthLoss);

// S3IM (Xie et al. 2023): the similarity of random groups of pixels. `patches` times, all rays are put in an order (the
// first time their own; then by a Fisher-Yates shuffle, i from n - 1 down to 1 swapped with below(i, i + 1) of
// RandomStream(mix64(seed) + patch, 0x531)) and cut into groups of 16, what is left over is not used; a group counts as
// a 4×4 picture with separable weights .136465, .265797, .331941, .265797 (a Gaussian of σ = 1.5 about index 2). Per
// group and channel SSIM with C1 = 1e-4, C2 = 9e-4; loss = scale · (1 - mean over patches, groups and channels). With
// stride = kernel, as in the paper, that is its loss but for the border. Rays of weight 0 count as equal: predicted is
// taken for both, and they get no gradient; all other weights are alike. Fewer than 16 rays have no loss.
struct S3imLoss {
  float scale = 1;
  Count rays;
  uint32_t patches = 10;
  uint64_t seed = 0;             // differs for every step
  Slice<const float> predicted;  // [rays][3]
  Slice<const float> target;     // [rays][3]
  Slice<const float> weights;    // optional, [rays]
  Slice<float> loss;             // [1], overwritten
  Slice<float> gradients;        // [rays][3], added to
};
TESSERA_OPERATION(S3imLoss);

// City-on-Web, eq. 6: pulls the opacity of each block along a ray to 0 or 1. loss = scale · Σ -(α ln α + (1 - α) ln(1 -
// α)), α clamped to [1e-5, 1 - 1e-5] in value and gradient: beyond, the gradient stays what it is at the bound.
struct OpacityLoss {
  float scale = 1;
  Count segments;
  Slice<const float> opacities;   // [segments]
  Slice<float> loss;              // [1], overwritten
  Slice<float> opacityGradients;  // [segments], added to
};
TESSERA_OPERATION(OpacityLoss);

// City-on-Web, eq. 5 (with 1 - exp, not 1 - σv): what a renderer's step would see at random points. loss = scale · Σ (1
// - exp(-exp(logDensity) · runtimeStep)). Gradients are overwritten; through exp they clamp as in compositing.
struct SparsityLoss {
  float scale = 1;
  Count points;
  Slice<const float> logDensities;  // [points]
  Slice<const float> runtimeSteps;  // [points]
  Slice<float> loss;                // [1], overwritten
  Slice<float> gradients;           // [points]
};
TESSERA_OPERATION(SparsityLoss);

}  // namespace tessera

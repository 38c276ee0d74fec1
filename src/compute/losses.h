// Losses of rendered rays, with their gradients.
#pragma once

#include "compute/memory.h"
#include "compute/operation.h"

namespace tessera {

//   mse           r²
//   huber         r² / 2δ if |r| ≤ δ, else |r| - δ/2        (normalised as in instant-ngp: slope at most 1)
//   charbonnier   sqrt(r² + ε²)
enum class ColourLossKind { mse, huber, charbonnier };

// loss = scale · Σ_rays weight · Σ_channels f(predicted - target). The gradient is with respect to `predicted`.
struct ColourLoss {
  ColourLossKind kind = ColourLossKind::huber;
  float parameter = 0.1f;  // δ or ε
  float scale = 1;         // usually 1 / (3 · rays)
  Count rays;
  Slice<const float> predicted;  // [rays][3]
  Slice<const float> target;     // [rays][3]
  Slice<const float> weights;    // optional, [rays]: 0 excludes a ray (masks)
  Slice<float> loss;             // [2], overwritten: the loss, and Σ weight · Σ r² (for PSNR)
  Slice<float> gradients;        // [rays][3], overwritten
};
TESSERA_OPERATION(ColourLoss);

// Distortion loss (Barron et al. 2022, eq. 15), computed in O(n) per ray on normalised positions s = g(t), where
// g(t) = t/2 for t < 1 and 1 - 1/(2t) beyond (the warp of MERF): Σ_ij w_i w_j |s_i - s_j| + Σ_i w_i² Δs_i / 3. The
// intervals are [t - step/2, t + step/2], and s_i is the mean of both ends in s. Distances increase along a ray.
// loss[0] = scale · Σ_rays. With `normalised`, distances and steps are already in s, and nothing is warped.
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

// Depth supervision: pulls the weights of a ray towards the distance D of a point from structure from motion.
// loss = scale · Σ_rays (1 - Σ_i w_i (1 - r_i)), r_i = min(1, max(0, |t_i - D| / D - tolerance)). This is the
// Wasserstein distance between the weights of the ray and a surface at D, relative to D; the weight of the background,
// and of samples at twice the distance or more, counts as 1.
struct DepthLoss {
  float scale = 1;
  float tolerance = 0.01f;
  Count rays;
  Slice<const uint32_t> firstSample;  // [rays + 1]
  Slice<const float> weights;         // [samples]
  Slice<const float> distances;       // [samples]
  Slice<const float> known;           // [rays]: D; 0 if unknown: the ray has no loss
  Slice<float> loss;                  // [1], overwritten
  Slice<float> weightGradients;       // [samples], added to
};
TESSERA_OPERATION(DepthLoss);

// S3IM (Xie et al. 2023): the structural similarity of random groups of pixels. For each of `patches` patches, all rays
// are ordered (in the first patch as given, in the others by a Fisher-Yates shuffle that swaps i, from n - 1 down to 1,
// with below(i, i + 1) of RandomStream(mix64(seed) + patch, 0x531)) and cut into groups of 16; a remainder is not used.
// A group is treated as a 4×4 image with the separable weights .136465, .265797, .331941, .265797 (a Gaussian with
// σ = 1.5 about index 2). SSIM is computed per group and channel with C1 = 1e-4 and C2 = 9e-4, and loss = scale ·
// (1 - mean over patches, groups and channels). With stride = kernel size, as in the paper, this is its loss except at
// the border. A ray of weight 0 counts as equal: its predicted colour also serves as its target, and it gets no
// gradient; all other weights have the same effect. Fewer than 16 rays have no loss.
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

// Opacity loss (City-on-Web, eq. 6): pulls the opacity of each block along a ray towards 0 or 1.
// loss = scale · Σ -(α ln α + (1 - α) ln(1 - α)), with α clamped to [1e-5, 1 - 1e-5] in the value and in the gradient:
// beyond the bounds, the gradient keeps its value at the bound.
struct OpacityLoss {
  float scale = 1;
  Count segments;
  Slice<const float> opacities;   // [segments]
  Slice<float> loss;              // [1], overwritten
  Slice<float> opacityGradients;  // [segments], added to
};
TESSERA_OPERATION(OpacityLoss);

// Sparsity loss (City-on-Web, eq. 5, with 1 - exp instead of 1 - σv): the opacity of a renderer's step at random
// points. loss = scale · Σ (1 - exp(-exp(logDensity) · runtimeStep)). Overwrites gradients; the gradient of exp is
// clamped as in compositing (Extinction::logDensity).
struct SparsityLoss {
  float scale = 1;
  Count points;
  Slice<const float> logDensities;  // [points]
  Slice<const float> runtimeSteps;  // [points]
  Slice<float> loss;                // [1], overwritten
  Slice<float> gradients;           // [points]
};
TESSERA_OPERATION(SparsityLoss);

// The expected squared error of a renderer that draws layers of triangles without sorting them: for each pixel it shows
// layer i with probability w_i (dithering), so that averages over pixels are right, and pixels are noisy.
// loss = scale · Σ_rays rayWeight · (Σ_i w_i |c_i|² + (1 - opacity) |background|² - |colour|²), the variance of what a
// pixel shows. Weights, colours of samples, colours of rays and opacities count as independent variables:
// CompositeBackward takes the gradients on to what they are computed from.
struct DitherLoss {
  float scale = 1;
  Count rays;
  Slice<const float> rayWeights;      // optional, [rays]: 0 excludes a ray (masks)
  Slice<const uint32_t> firstSample;  // [rays + 1]
  Slice<const float> weights;         // [samples]
  Matrix<const float> colours;        // [samples], 3 columns
  Slice<const float> colour;          // [rays][3], from CompositeForward; includes (1 - opacity) · background
  Slice<const float> opacity;         // [rays]; read only with a background
  Slice<const float> background;      // optional, [rays][3]; black if absent
  Slice<float> loss;                  // [1], overwritten
  Slice<float> weightGradients;       // [samples], overwritten
  Matrix<float> colourGradients;      // [samples], 3 columns, added to
  Slice<float> rayColourGradients;    // [rays][3], added to
  Slice<float> rayOpacityGradients;   // [rays], added to; required only with a background
};
TESSERA_OPERATION(DitherLoss);

}  // namespace tessera

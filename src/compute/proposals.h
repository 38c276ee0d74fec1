// Proposal sampling (mip-NeRF 360, Barron et al. 2022, section 3, in the form of nerfacto): a coarse field predicts
// where along a ray samples are worthwhile.
#pragma once

#include "compute/memory.h"
#include "compute/operation.h"

namespace tessera {

// Resamples fences from a histogram. Per ray, with the padding `uniformFraction`: p_j = (1 - padding) · w_j^anneal /
// Σ w^anneal + padding / before (if Σ = 0: uniform over the intervals). The cumulative sum is clamped to exactly 0 and
// 1 at its ends, and the new fences are its piecewise linear inverse at u_i = (i + jitter - ½) / after. The first and
// the last fence do not change: the fences cover the whole ray, because content outside them would never be learned.
// Positions have no gradient.
struct ResampleFences {
  Count rays;
  uint32_t before = 64, after = 32;  // intervals
  float anneal = 1;
  float uniformFraction = 0.01f;
  Slice<const float> fences;   // [rays][before + 1]
  Slice<const float> weights;  // [rays][before], not negative
  Slice<const float> jitter;   // optional, [rays], in [0,1); 1/2 if absent
  Slice<float> resampled;      // [rays][after + 1]
};
TESSERA_OPERATION(ResampleFences);

// Interlevel loss: the histogram of the proposal should be an upper bound of that of the samples. For sample i on [a,
// b] with weight w_i, B_i is the sum of the proposal's bins from the one that contains a (the last fence ≤ a) to the
// one that contains b (up to the first fence > b). loss = scale · Σ_rays Σ_i max(0, w_i - B_i)² / (w_i + 1e-7).
// Gradients are computed for the weights of the proposal only.
struct InterlevelLoss {
  float scale = 1;
  Count rays;
  uint32_t intervals = 64;
  Slice<const float> fences;           // [rays][intervals + 1]
  Slice<const float> weights;          // [rays][intervals]
  Slice<const uint32_t> firstSample;   // [rays + 1]
  Slice<const float> middles, widths;  // [samples], in s
  Slice<const float> sampleWeights;    // [samples]
  Slice<float> loss;                   // [1], overwritten
  Slice<float> weightGradients;        // [rays][intervals], overwritten
};
TESSERA_OPERATION(InterlevelLoss);

}  // namespace tessera

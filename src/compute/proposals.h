// Proposal sampling (mip-NeRF 360, Barron et al. 2022, section 3; nerfacto's form of it): a coarse field says where
// along a ray it is worth looking.
#pragma once

#include "compute/memory.h"
#include "compute/operation.h"

namespace tessera {

// New fence posts where the old histogram has weight. Per ray: p_j = (1 - padding) · w_j^anneal / Σ w^anneal + padding
// / before (with Σ = 0: evenly over the intervals), the cumulative sum clamped to exactly 0 and 1 at its ends; the new
// posts are its piecewise linear inverse at u_i = (i + jitter - ½) / after. The first and the last are those of before:
// no part of a ray goes unseen, or what it holds would never be learned. Positions have no gradient.
struct ResampleFences {
  Count rays;
  uint32_t before = 64, after = 32;  // intervals
  float anneal = 1;
  float padding = 0.01f;
  Slice<const float> fences;   // [rays][before + 1]
  Slice<const float> weights;  // [rays][before], not negative
  Slice<const float> jitter;   // optional, [rays], in [0,1); else 1/2
  Slice<float> resampled;      // [rays][after + 1]
};
TESSERA_OPERATION(ResampleFences);

// Interlevel loss: the proposal's histogram should be an upper bound of the samples'. For sample i on [a, b] with
// weight w_i, B_i sums the proposal's bins from the one that holds a (the last fence ≤ a) to the one that holds b (up
// to the first fence > b). loss = scale · Σ_rays Σ_i max(0, w_i - B_i)² / (w_i + 1e-7). Gradients are of the proposal's
// weights alone.
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

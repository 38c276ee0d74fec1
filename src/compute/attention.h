// NGP-RT's explicit features and the attention that fuses their levels (section 4.2, eq. 6 to 8).
#pragma once

#include "compute/memory.h"
#include "compute/operation.h"

namespace tessera {

// What weighs a fine level: nothing (the sum), one number, or one for density and one for colours.
enum class AttentionWeights { none, shared, separate };

struct AttentionShape {
  static constexpr uint32_t kFeatures = 8;    // logarithm of density, diffuse r g b, 4 features
  static constexpr uint32_t kMostLevels = 4;  // so that features and logits are at most 16
  static constexpr float kMostDensity = 15;   // of the logarithm

  uint32_t levels = 2;
  AttentionWeights weights = AttentionWeights::separate;
  bool varies = true;  // from place to place; else the whole model has one set

  uint32_t logits() const {
    return weights == AttentionWeights::none ? 0 : weights == AttentionWeights::shared ? levels : 2 * levels;
  }
};

// features = coarse + Σ_l [ω_l σ_l, β_l c_l, β_l v_l], ω and β sigmoids of logits: l and l where shared, else 2l and
// 2l + 1. The first, the logarithm of density, is at most kMostDensity.
struct AttentionForward {
  const AttentionShape& shape;
  Count samples;
  Matrix<const float> coarse;  // 16 columns: 8 features, then logits where they vary
  Matrix<const float> fine;    // 8 columns a level
  Slice<const float> logits;   // [shape.logits()] where they do not vary
  Matrix<float> features;      // 8 columns
};
TESSERA_OPERATION(AttentionForward);

// Overwrites coarseGradients and fineGradients, adds to logitGradients. The bound on density passes gradients on, as
// exponentials are truncated (Extinction::logDensity).
struct AttentionBackward {
  const AttentionShape& shape;
  Count samples;
  Matrix<const float> coarse, fine;
  Slice<const float> logits;
  Slice<const float> logDensityGradients;  // [samples]
  Matrix<const float> colourGradients;     // 7 columns
  Matrix<float> coarseGradients, fineGradients;
  Slice<float> logitGradients;  // [shape.logits()] where they do not vary
};
TESSERA_OPERATION(AttentionBackward);

// NGP-RT, eq. 5, with the sigmoid of its supplement: what a ray's samples add up to, and what its direction adds to
// that, become a colour. colour = g · sigmoid(diffuse + specular), g the opacity, or 1 where there is nothing else to
// be seen behind (`whole`): rays without samples then show what the network says of their direction.
struct ShadeForward {
  bool whole = false;
  Count rays;
  Matrix<const float> diffuse;   // 3 columns
  Matrix<const float> specular;  // 3 columns
  Slice<const float> opacity;    // [rays]; not with `whole`
  Slice<float> colour;           // [rays][3]
};
TESSERA_OPERATION(ShadeForward);

// Overwrites sumGradients, which are those of diffuse and of specular. Adds to opacityGradients.
struct ShadeBackward {
  bool whole = false;
  Count rays;
  Matrix<const float> diffuse, specular;
  Slice<const float> opacity;
  Slice<const float> colourGradients;  // [rays][3]
  Matrix<float> sumGradients;          // 3 columns
  Slice<float> opacityGradients;       // [rays]; not with `whole`
};
TESSERA_OPERATION(ShadeBackward);

}  // namespace tessera

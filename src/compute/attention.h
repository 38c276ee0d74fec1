// The explicit features of NGP-RT and the attention that fuses their levels (section 4.2, eq. 6 to 8).
#pragma once

#include "compute/memory.h"
#include "compute/operation.h"

namespace tessera {

// How a fine level is weighted: not at all (a plain sum), by one weight, or by one weight for density and one for
// colours.
enum class AttentionWeights { none, shared, separate };

struct AttentionShape {
  static constexpr uint32_t kFeatures = 8;   // logarithm of density, diffuse r g b, 4 features
  static constexpr uint32_t kMaxLevels = 4;  // so that a coarse row (features and logits) has at most 16 columns
  static constexpr float kMaxDensity = 15;   // upper bound of the logarithm of density

  uint32_t levels = 2;
  AttentionWeights weights = AttentionWeights::separate;
  bool varies = true;  // weights vary with the position; otherwise the whole model has one set

  uint32_t logits() const {
    return weights == AttentionWeights::none ? 0 : weights == AttentionWeights::shared ? levels : 2 * levels;
  }
};

// features = coarse + Σ_l [ω_l σ_l, β_l c_l, β_l v_l], where ω_l and β_l are the sigmoids of logits: both of logit l if
// the weights are shared, otherwise of logits 2l and 2l + 1. The first feature, the logarithm of density, is clamped to
// at most kMaxDensity.
struct AttentionForward {
  const AttentionShape& shape;
  Count samples;
  Matrix<const float> coarse;  // 16 columns: 8 features, then the logits if they vary
  Matrix<const float> fine;    // 8 columns per level
  Slice<const float> logits;   // [shape.logits()] if they do not vary
  Matrix<float> features;      // 8 columns
};
TESSERA_OPERATION(AttentionForward);

// Overwrites coarseGradients and fineGradients, and adds to logitGradients. The clamp at kMaxDensity passes gradients
// through unchanged, as the truncated exponential of Extinction::logDensity does.
struct AttentionBackward {
  const AttentionShape& shape;
  Count samples;
  Matrix<const float> coarse, fine;
  Slice<const float> logits;
  Slice<const float> logDensityGradients;  // [samples]
  Matrix<const float> colourGradients;     // 7 columns
  Matrix<float> coarseGradients, fineGradients;
  Slice<float> logitGradients;  // [shape.logits()] if they do not vary
};
TESSERA_OPERATION(AttentionBackward);

// Deferred shading of NGP-RT, eq. 5, with the sigmoid of its supplement: computes the colour of a ray from its
// composited diffuse term and the view-dependent (specular) term. colour = g · sigmoid(diffuse + specular), where g is
// the opacity of the ray. With `whole`, nothing can be seen behind the model and g = 1: rays without samples then have
// the colour that the network predicts for their direction.
struct ShadeForward {
  bool whole = false;
  Count rays;
  Matrix<const float> diffuse;   // 3 columns
  Matrix<const float> specular;  // 3 columns
  Slice<const float> opacity;    // [rays]; not used with `whole`
  Slice<float> colour;           // [rays][3]
};
TESSERA_OPERATION(ShadeForward);

// Overwrites sumGradients, the gradients with respect to diffuse + specular, and so to each of them. Adds to
// opacityGradients.
struct ShadeBackward {
  bool whole = false;
  Count rays;
  Matrix<const float> diffuse, specular;
  Slice<const float> opacity;
  Slice<const float> colourGradients;  // [rays][3]
  Matrix<float> sumGradients;          // 3 columns
  Slice<float> opacityGradients;       // [rays]; not used with `whole`
};
TESSERA_OPERATION(ShadeBackward);

}  // namespace tessera

// What City-on-Web does with a ray's blocks: each has composited its own samples to a diffuse colour, features and an
// opacity; each block's deferred network adds what depends on the direction; blocks are blended in order (eq. 3 and 4).
#pragma once

#include "compute/memory.h"

namespace tessera {

// 3 diffuse + 4 features + 27 of the direction (FrequencyForward, 4 frequencies) → hidden → hidden → 3: ReLU, biases, a
// sigmoid at the end. One network's parameters: for each layer the weights [outputs][inputs], then the biases
// [outputs].
struct DeferredNetwork {
  static constexpr uint32_t kComposited = 7, kDirection = 27, kInputs = kComposited + kDirection, kHidden = 16;
  static constexpr uint32_t kWeights[] = {0, kInputs* kHidden + kHidden,
                                          kInputs* kHidden + kHidden + kHidden* kHidden + kHidden};  // of each layer
  static constexpr uint32_t kParameters = kWeights[2] + kHidden * 3 + 3;
};

struct DeferredForward {
  Count segments;
  Slice<const float> composited;           // [segments][7]
  Slice<const uint32_t> networkOfSegment;  // [segments]
  Slice<const uint32_t> rayOfSegment;      // [segments]
  Slice<const float> directions;           // [rays][3], unit
  Slice<const float> networks;             // [networks][kParameters]
  Slice<float> specular;                   // [segments][3]
};

// Adds to compositedGradients and networkGradients.
struct DeferredBackward {
  Count segments;
  Slice<const float> composited;
  Slice<const uint32_t> networkOfSegment;
  Slice<const uint32_t> rayOfSegment;
  Slice<const float> directions;
  Slice<const float> networks;
  Slice<const float> specularGradients;  // [segments][3]
  Slice<float> compositedGradients;      // [segments][7]
  Slice<float> networkGradients;         // [networks][kParameters]
};

// Per ray, front to back over its segments k with opacity α^k:
//   C = Σ_k T^k (C_d^k + g^k Φ^k),  T^k = Π_{j<k} (1 - α^j);  opacity = 1 - Π (1 - α^k),  depth = Σ_k T^k depth^k
// with g^k = α^k, so that a block that holds nothing adds nothing; `literal` is the printed equation, g^k = 1.
struct BlendForward {
  bool literal = false;
  Count rays;
  Slice<const uint32_t> firstSegment;  // [rays + 1]
  Slice<const float> composited;       // [segments][7]: C_d is the first 3
  Slice<const float> specular;         // [segments][3]: Φ
  Slice<const float> opacities;        // [segments]: α
  Slice<const float> depths;           // [segments]
  Slice<float> colour;                 // [rays][3]
  Slice<float> opacity;                // [rays]
  Slice<float> depth;                  // [rays]
};

// Overwrites all three gradients of segments (features' with zero).
struct BlendBackward {
  bool literal = false;
  Count rays;
  Slice<const uint32_t> firstSegment;
  Slice<const float> composited, specular, opacities;
  Slice<const float> rayColourGradients;   // [rays][3]
  Slice<const float> rayOpacityGradients;  // optional, [rays]
  Slice<float> compositedGradients;        // [segments][7]
  Slice<float> specularGradients;          // [segments][3]
  Slice<float> opacityGradients;           // [segments]
};

}  // namespace tessera

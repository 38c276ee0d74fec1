// What City-on-Web does with a ray's blocks: each has composited its own samples to a diffuse colour, features and an
// opacity; each block's deferred network adds what depends on the direction; blocks are blended in order (eq. 3 and 4).
#pragma once

#include "compute/memory.h"
#include "compute/operation.h"

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
TESSERA_OPERATION(DeferredForward);

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
TESSERA_OPERATION(DeferredBackward);

}  // namespace tessera

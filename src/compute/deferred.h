// Deferred shading per block (City-on-Web, eq. 3 and 4): each block composites its own samples along a ray to a diffuse
// colour, features and an opacity, and the deferred network of the block adds the view-dependent (specular) colour. The
// blocks are then blended in order (compute/blend.h).
#pragma once

#include "compute/memory.h"
#include "compute/operation.h"

namespace tessera {

// A network of three layers with biases: 3 diffuse + 4 features + 27 of the encoded direction (FrequencyForward,
// 4 frequencies) → hidden → hidden → 3. ReLU follows the hidden layers and a sigmoid follows the last. The parameters
// of one network are, for each layer, the weights [outputs][inputs] followed by the biases [outputs].
struct DeferredNetwork {
  static constexpr uint32_t kComposited = 7, kDirection = 27, kInputs = kComposited + kDirection, kHidden = 16;
  static constexpr uint32_t kWeights[] = {0, kInputs* kHidden + kHidden,
                                          kInputs* kHidden + kHidden + kHidden* kHidden + kHidden};  // layer offsets
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

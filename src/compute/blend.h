// Blends the segments of a ray, each of them composited and shaded, into the colour of the ray (City-on-Web).
#pragma once

#include "compute/memory.h"
#include "compute/operation.h"

namespace tessera {

// Per ray, front to back over its segments k with opacity α^k:
//   C = Σ_k T^k (C_d^k + g^k Φ^k),  T^k = Π_{j<k} (1 - α^j);  opacity = 1 - Π (1 - α^k),  depth = Σ_k T^k depth^k
// with g^k = α^k, so that an empty block contributes nothing. `literal` selects the equation as printed in the paper,
// g^k = 1.
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
TESSERA_OPERATION(BlendForward);

// Overwrites all three gradients of the segments. The gradients of the composited features are set to zero.
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
TESSERA_OPERATION(BlendBackward);

}  // namespace tessera

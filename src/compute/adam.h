// Adam as tiny-cuda-nn does it: epsilon is added to the un-debiased root, every parameter counts its own steps, and a
// parameter whose gradient is exactly zero may be left wholly alone.
//
//   g += l2 · θ;  m = β1 m + (1-β1) g;  v = β2 v + (1-β2) g²;  k += 1
//   θ -= rate · sqrt(1 - β2^k) / (1 - β1^k) · m / (sqrt(v) + ε)
#pragma once

#include "compute/memory.h"
#include "compute/operation.h"

namespace tessera {

struct Adam {
  float rate = 1e-2f;
  float beta1 = 0.9f, beta2 = 0.99f;
  float epsilon = 1e-15f;
  float l2 = 0;
  bool skipZeroGradients = false;  // for hash tables: no moment decay, no count
  Slice<const uint32_t> rows;      // optional, [2]: where both are the same, no sample came here, and nothing is done
  // Optional, any number of counters of what a step found: where one is above `room`, there was no room for all of it,
  // and the step teaches nothing. Gradients become zero, and nothing else changes.
  Slice<const uint32_t> found;
  uint32_t room = 0;
  Slice<float> parameters;     // [n]
  Slice<float> gradients;      // [n]; zero afterwards
  Slice<float> firstMoments;   // [n]
  Slice<float> secondMoments;  // [n]
  Slice<uint32_t> counts;      // [n]: steps taken
};
TESSERA_OPERATION(Adam);

}  // namespace tessera

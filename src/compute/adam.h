// Adam in tiny-cuda-nn's form: epsilon is added to the square root without bias correction, every parameter counts its
// own steps, and a parameter whose gradient is exactly zero can be skipped entirely.
//
//   g += l2 · θ;  m = β1 m + (1-β1) g;  v = β2 v + (1-β2) g²;  k += 1
//   θ -= rate · sqrt(1 - β2^k) / (1 - β1^k) · m / (sqrt(v) + ε);  θ = min(max(θ, -bound), bound)
#pragma once

#include <limits>

#include "compute/memory.h"
#include "compute/operation.h"

namespace tessera {

struct Adam {
  float rate = 1e-2f;
  float beta1 = 0.9f, beta2 = 0.99f;
  float epsilon = 1e-15f;
  float l2 = 0;
  float bound = std::numeric_limits<float>::infinity();  // of the absolute values of parameters
  bool skipZeroGradients = false;  // for hash tables: neither decays the moments nor counts the step
  Slice<const uint32_t> rows;      // optional, [2]: equal values mean that no sample contributed; nothing is done then
  // Optional, any number of counters. A counter above `capacity` means that the step overflowed a buffer and its
  // gradients are incomplete: the gradients are set to zero, and nothing else changes.
  Slice<const uint32_t> overflowCounters;
  uint32_t capacity = 0;
  Slice<float> parameters;     // [n]
  Slice<float> gradients;      // [n]; zero afterwards
  Slice<float> firstMoments;   // [n]
  Slice<float> secondMoments;  // [n]
  Slice<uint32_t> counts;      // [n]: steps taken
};
TESSERA_OPERATION(Adam);

}  // namespace tessera

// Initial values of parameters, functions of the seed alone.
#pragma once

#include <cstdint>
#include <vector>

#include "compute/mlp.h"

namespace tessera {

std::vector<float> initialTable(size_t count, uint64_t seed);                              // uniform in ±1e-4
std::vector<float> initialWeights(const MlpShape& shape, uint64_t seed, uint64_t stream);  // Xavier, on padded sizes

}  // namespace tessera

// Encodings of directions and positions by fixed functions.
#pragma once

#include "compute/memory.h"
#include "compute/operation.h"

namespace tessera {

// Real spherical harmonics with tiny-cuda-nn's order and signs; degree² columns, degree 1 to 4. `directions` are unit.
struct SphericalHarmonicsForward {
  int degree = 4;
  Count samples;
  Slice<const float> directions;      // [rays][3]
  Slice<const uint32_t> rayOfSample;  // optional, [capacity]: which direction a sample has; else its own index
  Matrix<float> encoded;              // [capacity][degree²], row-major
};
TESSERA_OPERATION(SphericalHarmonicsForward);

// Overwrites `directionGradients` (per sample). The gradient is of the polynomials as functions on R³.
struct SphericalHarmonicsBackward {
  int degree = 4;
  Count samples;
  Slice<const float> directions;
  Slice<const uint32_t> rayOfSample;
  Matrix<const float> encodedGradients;
  Slice<float> directionGradients;  // [capacity][3]
};
TESSERA_OPERATION(SphericalHarmonicsBackward);

// x, then sin(2^k x) for k in [0, frequencies), then cos(2^k x): per k all input components (MERF's order).
// dimensions × (1 + 2 · frequencies) columns.
struct FrequencyForward {
  int dimensions = 3;
  int frequencies = 4;
  Count samples;
  Slice<const float> inputs;  // [capacity][dimensions]
  Matrix<float> encoded;      // row-major
};
TESSERA_OPERATION(FrequencyForward);

// Overwrites `inputGradients`.
struct FrequencyBackward {
  int dimensions = 3;
  int frequencies = 4;
  Count samples;
  Slice<const float> inputs;
  Matrix<const float> encodedGradients;
  Slice<float> inputGradients;  // [capacity][dimensions]
};
TESSERA_OPERATION(FrequencyBackward);

}  // namespace tessera

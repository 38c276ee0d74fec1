// Fixed (not learned) encodings of directions and positions.
#pragma once

#include "compute/memory.h"
#include "compute/operation.h"

namespace tessera {

// Real spherical harmonics of unit directions, in the order and with the signs of tiny-cuda-nn: degree² columns, for
// degrees 1 to 4.
struct SphericalHarmonicsForward {
  int degree = 4;
  Count samples;
  Slice<const float> directions;      // [rays][3]
  Slice<const uint32_t> rayOfSample;  // optional, [capacity]: the direction of a sample; its own index if absent
  Matrix<float> encoded;              // [capacity][degree²], row-major
};
TESSERA_OPERATION(SphericalHarmonicsForward);

// Overwrites `directionGradients` (per sample). The gradient is that of the polynomials as functions on R³, not on the
// sphere.
struct SphericalHarmonicsBackward {
  int degree = 4;
  Count samples;
  Slice<const float> directions;
  Slice<const uint32_t> rayOfSample;
  Matrix<const float> encodedGradients;
  Slice<float> directionGradients;  // [capacity][3]
};
TESSERA_OPERATION(SphericalHarmonicsBackward);

// Frequency encoding: x, then sin(2^k x) for k in [0, frequencies), then cos(2^k x), each with all input components per
// k (the order of MERF). The encoding has dimensions × (1 + 2 · frequencies) columns.
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

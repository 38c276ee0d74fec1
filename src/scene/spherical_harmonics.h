// Real spherical harmonics, for renderers of scenes; compute/encodings.h has them for training.
#pragma once

#include <array>

#include "scene/axes.h"

namespace tessera {

// Returns the first 16 of a unit direction, in the order and with the signs of tiny-cuda-nn. The first 9 are those up to
// degree 2.
inline std::array<float, 16> evaluateHarmonics(const Vec3d& direction) {
  const float x = static_cast<float>(direction[0]), y = static_cast<float>(direction[1]),
              z = static_cast<float>(direction[2]);
  return {0.28209479177387814f,
          -0.48860251190291987f * y,
          0.48860251190291987f * z,
          -0.48860251190291987f * x,
          1.0925484305920792f * x * y,
          -1.0925484305920792f * y * z,
          0.94617469575755997f * z * z - 0.31539156525251999f,
          -1.0925484305920792f * x * z,
          0.54627421529603959f * (x * x - y * y),
          0.59004358992664352f * y * (y * y - 3 * x * x),
          2.8906114426405538f * x * y * z,
          0.45704579946446572f * y * (1 - 5 * z * z),
          0.37317633259011546f * z * (5 * z * z - 3),
          0.45704579946446572f * x * (1 - 5 * z * z),
          1.4453057213202769f * z * (x * x - y * y),
          0.59004358992664352f * x * (3 * y * y - x * x)};
}

}  // namespace tessera

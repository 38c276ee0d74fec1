// Cube maps (Greene 1986): colours by direction, of what lies infinitely far away. The purpose is the sky behind a
// scene.
//
// A map has six sides of R × R texels: +x, -x, +y, -y, +z and -z, in this order. The side of a direction d is that of
// its component of largest absolute value, the first axis of equal ones. With a that axis, b = (a + 1) mod 3 and
// c = (a + 2) mod 3, the direction meets the side at column (d_b / |d_a| + 1) / 2 · (R - 1) and row
// (d_c / |d_a| + 1) / 2 · (R - 1), so that the outermost texels lie on the edges of the side. Texel (column, row) of
// side s has the number (s R + row) R + column. The colour of a direction is the bilinear mix of the four texels around
// that place: those of the columns min(⌊column⌋, R - 2) and the next, and of the rows likewise. A direction of zero has
// the colour zero and no gradient.
#pragma once

#include "compute/memory.h"
#include "compute/operation.h"

namespace tessera {

// Overwrites `colours`.
struct CubeMapForward {
  uint32_t resolution = 0;  // R, at least 2
  Count rays;
  Slice<const float> directions;  // [rays][3], of any length
  Slice<const float> texels;      // [6][R][R][3]
  Slice<float> colours;           // [rays][3]
};
TESSERA_OPERATION(CubeMapForward);

// The gradient with respect to the texels; there is none with respect to directions. With `opacity`, that of what lies
// in front of the map, gradients are multiplied by 1 - opacity. Adds to `texelGradients`.
struct CubeMapBackward {
  uint32_t resolution = 0;  // R, at least 2
  Count rays;
  Slice<const float> directions;          // [rays][3]
  Slice<const float> opacity;             // optional, [rays]
  Slice<const float> rayColourGradients;  // [rays][3]
  Slice<float> texelGradients;            // [6][R][R][3]
};
TESSERA_OPERATION(CubeMapBackward);

}  // namespace tessera

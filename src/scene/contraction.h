// MERF's piecewise-projective contraction (Reiser et al. 2023, eq. 4): it is the identity in the cube [-1,1]³ and maps
// everything outside the cube into (-2,2)³. Straight lines stay straight within each of its seven regions: the cube,
// and one pyramid per side.
#pragma once

#include <array>
#include <cmath>

namespace tessera {

template <class T>
using Triple = std::array<T, 3>;

// Returns the axis of the coordinate of largest magnitude, the first of several equal ones.
template <class T>
int farthestAxis(const Triple<T>& x) {
  int axis = 0;
  for (int a = 1; a < 3; ++a) {
    if (std::abs(x[a]) > std::abs(x[axis])) axis = a;
  }
  return axis;
}

template <class T>
Triple<T> contract(const Triple<T>& x) {
  const int axis = farthestAxis(x);
  const T m = std::abs(x[axis]);
  if (!(m > 1)) return x;
  Triple<T> y = {x[0] / m, x[1] / m, x[2] / m};
  y[axis] = std::copysign(2 - 1 / m, x[axis]);
  return y;
}

// The inverse of the contraction on (-2,2)³. A point with two coordinates beyond 1 has no preimage in the scene.
template <class T>
Triple<T> uncontract(const Triple<T>& y) {
  const int axis = farthestAxis(y);
  const T far = std::abs(y[axis]);
  if (!(far > 1)) return y;
  const T m = 1 / (2 - far);
  Triple<T> x = {y[0] * m, y[1] * m, y[2] * m};
  x[axis] = std::copysign(m, y[axis]);
  return x;
}

// The derivative of the contraction at x along d.
template <class T>
Triple<T> contractDirection(const Triple<T>& x, const Triple<T>& d) {
  const int axis = farthestAxis(x);
  const T m = std::abs(x[axis]);
  if (!(m > 1)) return d;
  const T growth = std::copysign(d[axis], x[axis] * d[axis]) / (m * m);  // of -1/m
  Triple<T> y;
  for (int a = 0; a < 3; ++a) y[a] = d[a] / m - x[a] * growth;
  y[axis] = d[axis] / (m * m);
  return y;
}

}  // namespace tessera

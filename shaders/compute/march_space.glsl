// The space that rays are marched through and its step lattice; src/compute/rays.h defines the convention.
// Reads: MarchSpaceArguments, real. Defines: stepIndexAt(), distanceAt(), Cell, cellAt(), exitDistance().

real stepIndexAt(MarchSpaceArguments s, real t) {
  if (s.cone <= 0 || t <= unpackReal(s.linearDistance)) return t / s.minStep;
  const real last = unpackReal(s.geometricDistance);
  if (t <= last) return unpackReal(s.linearEnd) + logReal(t / unpackReal(s.linearDistance)) / unpackReal(s.lambda);
  return unpackReal(s.geometricEnd) + (t - last) / s.maxStep;
}

real distanceAt(MarchSpaceArguments s, real n) {
  if (s.cone <= 0 || n <= unpackReal(s.linearEnd)) return n * s.minStep;
  const real last = unpackReal(s.geometricEnd);
  if (n <= last) return unpackReal(s.linearDistance) * expReal((n - unpackReal(s.linearEnd)) * unpackReal(s.lambda));
  return unpackReal(s.geometricDistance) + (n - last) * s.maxStep;
}

struct Cell {
  realVec3 u;   // grid coordinates in [0,1]
  ivec3 index;
  int region;   // contracted space: axis of the largest coordinate outside the unit cube; -1 inside
  real side;    // the sign of that coordinate
  bool inside;  // false outside the cube of a bounded space
};

Cell cellAt(MarchSpaceArguments s, realVec3 x) {
  Cell cell;
  cell.region = -1;
  cell.inside = true;
  cell.side = 1;
  if (s.contracted != 0) {
    int axis = 0;
    for (int a = 1; a < 3; ++a) {
      if (abs(x[a]) > abs(x[axis])) axis = a;
    }
    const real m = abs(x[axis]);
    realVec3 y = x;
    if (m > 1) {
      cell.region = axis;
      cell.side = x[axis] < 0 ? real(-1) : real(1);
      y = x / m;
      y[axis] = cell.side * (2 - 1 / m);
    }
    cell.u = (y + real(2)) / real(4);
  } else {
    cell.u = (x + real(1)) / real(2);
    for (int a = 0; a < 3; ++a) cell.inside = cell.inside && cell.u[a] >= 0 && cell.u[a] < 1;
  }
  for (int a = 0; a < 3; ++a) cell.index[a] = clamp(int(floor(cell.u[a] * s.resolution)), 0, s.resolution - 1);
  return cell;
}

// Returns the smaller of `exit` and the t where value + slope · t = 0, if that is greater than `from`.
real nearerCrossing(real exit, real from, real value, real slope) {
  if (slope == 0) return exit;
  const real at = -value / slope;
  return at > from ? min(exit, at) : exit;
}

// Returns the distance at which the ray leaves the cell. Every face of a cell is a plane: x_a = c inside; outside, for
// the region of axis a, x_a = side · 1/(2 - y) for its own axis and x_b = y · |x_a| for the others; and region borders
// are |x_b| = |x_a|.
real exitDistance(MarchSpaceArguments s, Cell cell, realVec3 o, realVec3 d, real t) {
  const real width = (s.contracted != 0 ? real(4) : real(2)) / s.resolution;
  const real origin = s.contracted != 0 ? real(-2) : real(-1);
  real exit = real(1e30);
  const int region = cell.region;
  const real om = region < 0 ? real(0) : cell.side * o[max(region, 0)];  // the largest coordinate along the ray
  const real dm = region < 0 ? real(0) : cell.side * d[max(region, 0)];
  for (int a = 0; a < 3; ++a) {
    const real low = origin + cell.index[a] * width, high = low + width;
    if (region < 0) {
      exit = nearerCrossing(exit, t, o[a] - low, d[a]);
      exit = nearerCrossing(exit, t, o[a] - high, d[a]);
    } else if (a == region) {
      if (2 - abs(low) > real(1e-12)) exit = nearerCrossing(exit, t, om - 1 / (2 - abs(low)), dm);
      if (2 - abs(high) > real(1e-12)) exit = nearerCrossing(exit, t, om - 1 / (2 - abs(high)), dm);
    } else {
      exit = nearerCrossing(exit, t, o[a] - low * om, d[a] - low * dm);
      exit = nearerCrossing(exit, t, o[a] - high * om, d[a] - high * dm);
    }
  }
  return exit;
}

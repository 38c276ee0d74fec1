// A ray through the domain of one part of a content as straight pieces, measured in texels of a grid that fills the
// domain (docs/tile-format.md, section 6; City-on-Web, section 4.4; MERF, section 4.1). Must match
// src/scene/domain_path.cpp.
//
// Defines: DomainSegment, rateAt, distanceAt, distanceBetween, regionAt, leaveRegion, domainSegment.

// The position after τ texels is start + τ direction, in texels from the lower corner of the domain. Within a region
// the contraction is a projective map, and so is the distance along the ray: entry + square τ / (rate - growth τ).
struct DomainSegment {
  vec3 start;
  vec3 direction;
  float whole;  // total length
  float entry, square, rate, growth;
};

// Returns rate - growth τ, clamped because rounding could make it zero or negative.
float rateAt(DomainSegment s, float tau) {
  return max(s.rate - s.growth * tau, 1e-7 * s.rate);
}

float distanceAt(DomainSegment s, float tau) {
  return s.entry + s.square * tau / rateAt(s, tau);
}

float distanceBetween(DomainSegment s, float from, float to) {
  return s.square * s.rate * (to - from) / (rateAt(s, from) * rateAt(s, to));
}

// The cube |x| <= 1 is region -1. Outside, if the coordinate of axis a has the largest magnitude, the region is 2a, or
// 2a + 1 if that coordinate is positive.
const int kCube = -1;

int regionAt(vec3 x) {
  vec3 m = abs(x);
  int axis = m.y > m.x ? 1 : 0;
  axis = m.z > m[axis] ? 2 : axis;
  return m[axis] > 1.0 ? 2 * axis + (x[axis] > 0.0 ? 1 : 0) : kCube;
}

// Returns the distance at which a ray in a region leaves it, and sets `next` to the following region. A region is
// bounded by planes, and the ray leaves it where it first crosses one of them outwards.
float leaveRegion(vec3 o, vec3 d, int region, out int next) {
  float exit = 1e30;
  next = kCube;
  if (region == kCube) {
    for (int a = 0; a < 3; ++a) {
      float t = ((d[a] > 0.0 ? 1.0 : -1.0) - o[a]) / d[a];
      if (d[a] != 0.0 && t < exit) {
        exit = t;
        next = 2 * a + (d[a] > 0.0 ? 1 : 0);
      }
    }
    return exit;
  }
  int a = region >> 1;
  float side = (region & 1) == 1 ? 1.0 : -1.0;
  float m = side * o[a], growth = side * d[a];
  if (growth < 0.0) exit = (1.0 - m) / growth;
  for (int k = 1; k < 3; ++k) {
    int b = (a + k) % 3;
    for (float other = -1.0; other < 2.0; other += 2.0) {
      float speed = other * d[b] - growth;  // relative growth of the other coordinate
      float t = (m - other * o[b]) / speed;
      if (speed > 0.0 && t < exit) {
        exit = t;
        next = 2 * b + (other > 0.0 ? 1 : 0);
      }
    }
  }
  return exit;
}

// Returns the piece of a ray (local coordinates, distances of the scene) from `near` to `far`, which lies in one
// region, in the domain [-halfDomain, halfDomain]³ with `texels` texels along an edge.
DomainSegment domainSegment(vec3 o, vec3 d, int region, float near, float far, float halfDomain, float texels) {
  DomainSegment s;
  vec3 y = o + near * d;
  vec3 v = d;
  float entryM = 1.0, exitM = 1.0, growth = 0.0;
  if (region != kCube) {
    int a = region >> 1;
    float side = (region & 1) == 1 ? 1.0 : -1.0;
    growth = side * d[a];
    entryM = side * y[a];
    exitM = side * (o[a] + far * d[a]);
    y /= entryM;
    y[a] = side * (2.0 - 1.0 / entryM);
    v = side * (d * o[a] - o * d[a]);
    v[a] = d[a];
  }
  float perUnit = texels / (2.0 * halfDomain);
  float speed = length(v);
  s.start = (y + halfDomain) * perUnit;
  s.direction = v / speed;
  s.whole = perUnit * speed * (far - near) / (entryM * exitM);
  s.entry = near;
  s.square = entryM * entryM;
  s.rate = speed * perUnit;
  s.growth = growth * entryM;
  return s;
}

// A ray through the domain of a block as straight pieces: one in a bounded block, one per region that it crosses in a
// contracted block. Must match src/scene/domain_path.cpp, here in `real`.
// Reads: real, Placement. Defines: DomainPiece, DomainPieces, makePieces(), nextPiece(), alongPiece(),
// alongPieceBetween().

// A straight piece: the position after a length τ is start + τ direction, in domain coordinates.
struct DomainPiece {
  realVec3 start, direction;
  real whole;  // total length
  real entry, square, rate, growth;
};

real alongPiece(DomainPiece s, real tau) { return s.entry + s.square * tau / (s.rate - s.growth * tau); }

real alongPieceBetween(DomainPiece s, real from, real to) {
  return s.square * s.rate * (to - from) / ((s.rate - s.growth * from) * (s.rate - s.growth * to));
}

const int kCube = -1;

// The cube is region -1; the pyramid on the side of axis a is 2a, or 2a + 1 where x_a is positive.
int regionAt(realVec3 x) {
  const int axis = farthestAxis(x);
  return abs(x[axis]) > 1 ? 2 * axis + (x[axis] > 0 ? 1 : 0) : kCube;
}

DomainPiece makePiece(realVec3 o, realVec3 d, int region, real near, real far) {
  realVec3 y = o + near * d, v = d;
  real entryM = real(1), exitM = real(1), growth = real(0);
  if (region != kCube) {
    const int a = region / 2;
    const real side = region % 2 == 1 ? real(1) : real(-1);
    growth = side * d[a];
    entryM = side * y[a];
    exitM = side * (o[a] + far * d[a]);
    y /= entryM;
    y[a] = side * (2 - 1 / entryM);
    v = side * (d * o[a] - o * d[a]);
    v[a] = d[a];
  }
  const real speed = length(v);
  return DomainPiece(y, v / speed, speed * (far - near) / (entryM * exitM), near, entryM * entryM, speed,
                     growth * entryM);
}

const uint kMaxEnds = 13;
const real kNothing = real(1e-3) * kRoundingShare;  // relative length below which an interval is a rounding error

// The rest of a ray in a domain, from which pieces are taken.
struct DomainPieces {
  realVec3 origin, direction;  // local; distances along it are those of the scene
  real ends[kMaxEnds];        // sorted distances at which regions may end
  uint count, next;
  real from, to;               // of the current piece
  int region;
};

void addEnd(inout DomainPieces p, real near, real far, real offset, real slope) {
  if (slope == 0) return;
  const real t = -offset / slope;
  if (!(t > near && t < far)) return;
  uint i = p.count++;
  for (; i > 0 && p.ends[i - 1] > t; --i) p.ends[i] = p.ends[i - 1];
  p.ends[i] = t;
}

// Prepares the ray from near to far, near < far.
DomainPieces makePieces(Placement placement, realVec3 origin, realVec3 direction, real near, real far) {
  DomainPieces p;
  p.origin = (origin - placement.centre) / placement.scale;
  p.direction = direction / placement.scale;
  p.count = p.next = 0;
  p.from = p.to = near;
  p.region = kCube;
  if (placement.contracted) {
    for (int a = 0; a < 3; ++a) {
      const int b = (a + 1) % 3;
      for (int side = -1; side < 2; side += 2) {
        addEnd(p, near, far, p.origin[a] + side, p.direction[a]);
        addEnd(p, near, far, p.origin[a] + side * p.origin[b], p.direction[a] + side * p.direction[b]);
      }
    }
  }
  p.ends[p.count++] = far;
  return p;
}

// Returns the next straight piece, or false if there are no more.
bool nextPiece(inout DomainPieces p, bool isContracted, out DomainPiece piece) {
  for (; p.next < p.count; ++p.next) {
    const real end = p.ends[p.next];
    if (end - p.to < kNothing * end) continue;
    const int region = isContracted ? regionAt(p.origin + (p.to + end) / 2 * p.direction) : kCube;
    const real from = p.from, to = p.to;
    const int before = p.region;
    p.region = region;
    p.to = end;
    if (region != before && from < to) {
      piece = makePiece(p.origin, p.direction, before, from, to);
      p.from = to;
      ++p.next;
      return true;
    }
  }
  if (!(p.from < p.to)) return false;
  piece = makePiece(p.origin, p.direction, p.region, p.from, p.to);
  p.from = p.to;
  return true;
}

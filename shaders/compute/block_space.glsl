// A scene partitioned into square blocks; src/compute/blocks.h defines the convention.
// Reads: BlockSpaceArguments, real. Defines: kBackgroundBlock…, kFarthest, Placement, computePlacement(), blockAt(),
// Range, rangeInBox(), alongShare(), shareAt(), contracted(), uncontracted(), contractedDirection(), runtimeStepAt(),
// WallWalk, makeWallWalk(), nextWall().

const uint kBackgroundBlockNone = 0, kBackgroundBlockBorder = 1, kBackgroundBlockOwn = 2;
const real kFarthest = real(1e6), kBoxShare = real(0.75), kNever = real(1e30);

struct Placement {
  realVec3 centre, scale;
  bool contracted;
  real halfDomain;
};

uint countCells(BlockSpaceArguments s) { return s.columns * s.rows; }

Placement computePlacement(BlockSpaceArguments s, uint block) {
  if (block == countCells(s)) return Placement(realVec3(0), realVec3(s.columns, s.rows, 1), true, real(2));
  const uint i = block % s.columns, j = block / s.columns;
  const bool atBorder = i == 0 || j == 0 || i + 1 == s.columns || j + 1 == s.rows;
  const bool isContracted = s.backgroundBlock == kBackgroundBlockBorder && atBorder;
  const realVec3 centre = realVec3(int(2 * i + 1) - int(s.columns), int(2 * j + 1) - int(s.rows), 0);
  return Placement(centre, realVec3(1), isContracted, isContracted ? real(2) : real(1));
}

// Returns the cell that contains x when [-count, count] is divided into `count` cells.
uint clampedCell(real x, uint count) {
  const real cell = (x + count) / 2;
  if (!(cell > 0)) return 0;
  return cell < count ? uint(cell) : count - 1;
}

uint blockAt(BlockSpaceArguments s, realVec3 x) {
  const bool inBox = abs(x.x) <= s.columns && abs(x.y) <= s.rows && x.z >= s.bottom && x.z <= s.top;
  if (s.backgroundBlock == kBackgroundBlockOwn && !inBox) return countCells(s);
  return clampedCell(x.x, s.columns) + s.columns * clampedCell(x.y, s.rows);
}

struct Range {
  real near, far;
};
bool isEmpty(Range range) { return !(range.near < range.far); }

Range rangeInBox(BlockSpaceArguments s, realVec3 o, realVec3 d, real near) {
  const realVec3 low = realVec3(-real(s.columns), -real(s.rows), s.bottom), high = realVec3(s.columns, s.rows, s.top);
  Range range = Range(near, kNever);
  for (int axis = 0; axis < 3; ++axis) {
    if (d[axis] == 0) {
      if (o[axis] < low[axis] || o[axis] > high[axis]) range.far = 0;
      continue;
    }
    const real toLow = (low[axis] - o[axis]) / d[axis], toHigh = (high[axis] - o[axis]) / d[axis];
    range.near = max(range.near, min(toLow, toHigh));
    range.far = min(range.far, max(toLow, toHigh));
  }
  return range;
}

// BlockSpace::distanceAt, and below its inverse.
real alongShare(BlockSpaceArguments s, real share, Range range) {
  if (s.backgroundBlock == kBackgroundBlockNone) return range.near + share * (range.far - range.near);
  if (share <= kBoxShare) return range.near + share / kBoxShare * (range.far - range.near);
  const real u = (share - kBoxShare) / (1 - kBoxShare);
  return 1 / ((1 - u) / range.far + u / kFarthest);
}

real shareAt(BlockSpaceArguments s, real t, Range range) {
  if (s.backgroundBlock == kBackgroundBlockNone) return (t - range.near) / (range.far - range.near);
  if (t <= range.far) return kBoxShare * ((t - range.near) / (range.far - range.near));
  return kBoxShare + (1 - kBoxShare) * ((1 / range.far - 1 / t) / (1 / range.far - 1 / kFarthest));
}

int farthestAxis(realVec3 x) {
  int axis = 0;
  for (int a = 1; a < 3; ++a) {
    if (abs(x[a]) > abs(x[axis])) axis = a;
  }
  return axis;
}

// MERF's contraction (src/scene/contraction.h), its inverse, and its derivative along d.
realVec3 contracted(realVec3 x) {
  const int axis = farthestAxis(x);
  const real m = abs(x[axis]);
  if (!(m > 1)) return x;
  realVec3 y = x / m;
  y[axis] = x[axis] < 0 ? 1 / m - 2 : 2 - 1 / m;
  return y;
}

realVec3 uncontracted(realVec3 y) {
  const int axis = farthestAxis(y);
  const real far = abs(y[axis]);
  if (!(far > 1)) return y;
  const real m = 1 / (2 - far);
  realVec3 x = y * m;
  x[axis] = y[axis] < 0 ? -m : m;
  return x;
}

realVec3 contractedDirection(realVec3 x, realVec3 d) {
  const int axis = farthestAxis(x);
  const real m = abs(x[axis]);
  if (!(m > 1)) return d;
  const real growth = (x[axis] < 0 ? -d[axis] : d[axis]) / (m * m);  // derivative of -1/m
  realVec3 y = d / m - x * growth;
  y[axis] = d[axis] / (m * m);
  return y;
}

// Returns the length in t of one texel at local coordinates q along `direction`; 0 if the direction is zero.
real runtimeStepAt(Placement placement, uint texels, realVec3 q, realVec3 direction) {
  realVec3 along = direction / placement.scale;
  if (placement.contracted) along = contractedDirection(q, along);
  const real speed = length(along);
  return speed > 0 && texels > 0 ? 2 * placement.halfDomain / texels / speed : real(0);
}

// The inner walls of cells in the order in which a ray meets them.
struct WallWalk {
  ivec2 next;   // the number of the next wall along x and along y
  ivec2 count;  // the number of walls along x and along y
};

WallWalk makeWallWalk(BlockSpaceArguments s, realVec3 direction) {
  const ivec2 walls = ivec2(s.columns, s.rows) - 1;
  return WallWalk(ivec2(0), ivec2(direction.x != 0 ? walls.x : 0, direction.y != 0 ? walls.y : 0));
}

// Returns the distance of wall `number` along an axis, counted in the direction of the ray.
real wallDistance(BlockSpaceArguments s, realVec3 o, realVec3 d, int axis, int number) {
  const int cells = int(axis == 0 ? s.columns : s.rows);
  const int wall = d[axis] > 0 ? 2 - cells + 2 * number : cells - 2 - 2 * number;
  return (wall - o[axis]) / d[axis];
}

// Returns the distance of the next wall of either axis; kNever after the last.
real nextWall(BlockSpaceArguments s, realVec3 o, realVec3 d, inout WallWalk walk) {
  const real x = walk.next.x < walk.count.x ? wallDistance(s, o, d, 0, walk.next.x) : kNever;
  const real y = walk.next.y < walk.count.y ? wallDistance(s, o, d, 1, walk.next.y) : kNever;
  ++walk.next[x <= y ? 0 : 1];
  return min(x, y);
}

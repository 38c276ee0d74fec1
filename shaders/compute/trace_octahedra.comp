// TraceOctahedra: one invocation per ray. The kernel runs twice: it counts hits, and after their prefix sums are known,
// finds them again and writes them. A ray walks through the cells and, in each occupied one, is tested against all faces
// that can reach into it; hits outside the cell are dropped, so that no face is hit twice and hits are sorted within a
// cell only. The walk is computed in double if possible, and the faces in float relative to the point at which the ray
// enters the cell.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "kernel.glsl"
#include "arguments_octahedra.h"
#include "octahedra.glsl"
#include "real.glsl"
#include "vectors.glsl"

layout(local_size_x = 32) in;  // small, because of the shared memory
layout(constant_id = 0) const bool kWrite = false;
KERNEL_ARGUMENTS(TraceOctahedraArguments)

#define PARAMETERS arguments.values

const uint kMaxHitsInCell = 64;  // the nearest are kept
const real kNever = real(1e30);

// A ray in homogeneous grid coordinates, start + t · slope, and its walk: g = entry + s · step, where the farthest
// coordinate advances by 1 per unit of s.
struct Ray {
  uint index, row, endRow;  // rows of its hits: none is written beyond, even if the second run rounds differently
  uint grid, firstCell;     // whose coordinates these are
  real start[4], slope[4];
  real near, far;
  realVec3 entry, step_;
  int z;  // the axis along which the ray is longest
};

struct Hit {
  float s;  // from the point at which the ray enters the cell
  uint face;
  vec2 barycentrics;
};

real coordinateAt(Ray ray, real t, int axis) {
  return (ray.start[axis] + t * ray.slope[axis]) / (ray.start[3] + t * ray.slope[3]);
}

// Limits near and far of a ray to the box in which faces are hit. All six bounds are linear in t.
void clipToGrid(inout Ray ray) {
  for (int axis = 0; axis < 3; ++axis) {
    const real low = PARAMETERS.grids[ray.grid].lowest[axis], high = PARAMETERS.grids[ray.grid].highest[axis];
    for (int side = 0; side < 2; ++side) {
      const real value = side == 1 ? high * ray.start[3] - ray.start[axis] : ray.start[axis] - low * ray.start[3];
      const real rise = side == 1 ? high * ray.slope[3] - ray.slope[axis] : ray.slope[axis] - low * ray.slope[3];
      if (rise > 0) {
        ray.near = max(ray.near, -value / rise);
      } else if (rise < 0) {
        ray.far = min(ray.far, -value / rise);
      } else if (value < 0) {
        ray.far = -kNever;
      }
    }
  }
}

// The distance at which a ray leaves the box, or 0 if it does not cross it.
real distanceBehindBox(vec3 origin, vec3 direction) {
  real enter = 0, leave = kNever;
  for (int axis = 0; axis < 3; ++axis) {
    const real halfEdge = PARAMETERS.boxInFront[axis];
    if (halfEdge <= 0) return real(0);
    if (direction[axis] == 0) {
      if (abs(origin[axis]) > halfEdge) return real(0);
      continue;
    }
    const real side = direction[axis] > 0 ? halfEdge : -halfEdge;
    enter = max(enter, (-side - real(origin[axis])) / real(direction[axis]));
    leave = min(leave, (side - real(origin[axis])) / real(direction[axis]));
  }
  return enter < leave ? leave : real(0);
}

bool isOccupied(uint grid, ivec3 cell) {
  const uint n = PARAMETERS.resolution, i = cell.x + n * (cell.y + n * cell.z);
  return (PARAMETERS.occupancy.values[grid * ((n * n * n + 31) / 32) + i / 32] >> i % 32 & 1) != 0;
}

// The vertices of the 27 cells around a ray's cell, relative to the point at which it enters the cell, and sheared so that
// the ray is the z axis. Each invocation has its own column.
const uint kCornerCells = 27;
shared float corners[3 * kCornerCells * gl_WorkGroupSize.x];

vec3 cornerAt(uint number) {
  const uint first = 3 * number * gl_WorkGroupSize.x + gl_LocalInvocationIndex;
  return vec3(corners[first], corners[first + gl_WorkGroupSize.x], corners[first + 2 * gl_WorkGroupSize.x]);
}

// Fills in the vertices of a cell; returns a bit for each that exists. `shear`: of x and y, and the sign of z.
uint placeCorners(Ray ray, ivec3 cell, vec3 origin, vec3 shear) {
  const int n = int(PARAMETERS.resolution), x = (ray.z + 1) % 3, y = (ray.z + 2) % 3;
  uint placed = 0;
  for (uint number = 0; number < kCornerCells; ++number) {
    const ivec3 offset = ivec3(number % 3, number / 3 % 3, number / 9) - 1, place = cell + offset;
    if (any(lessThan(place, ivec3(0))) || any(greaterThanEqual(place, ivec3(n)))) continue;
    placed |= 1u << number;
    const vec3 at = vec3(offset) + pointAt(PARAMETERS.displacements, ray.firstCell + place.x + n * (place.y + n * place.z)) - origin;
    const uint first = 3 * number * gl_WorkGroupSize.x + gl_LocalInvocationIndex;
    corners[first] = at[x] - shear.x * at[ray.z];
    corners[first + gl_WorkGroupSize.x] = at[y] - shear.y * at[ray.z];
    corners[first + 2 * gl_WorkGroupSize.x] = at[ray.z] * shear.z;
  }
  return placed;
}

// Finds the hits of a cell that the ray crosses from s = `enter` to `leave`, writes those that fit, and adds their number
// to `count`. Returns false if the ray has all that it may have.
bool addHits(Ray ray, ivec3 cell, real enter, real leave, inout uint count) {
  const int n = int(PARAMETERS.resolution), x = (ray.z + 1) % 3, y = (ray.z + 2) % 3;
  const vec3 step_ = vec3(ray.step_), origin = vec3(ray.entry + enter * ray.step_ - (realVec3(cell) + real(0.5)));
  const float shearX = step_[x] / step_[ray.z], shearY = step_[y] / step_[ray.z], sign_ = step_[ray.z] > 0 ? 1 : -1;
  const uint table = PARAMETERS.faceCount * ((cell.x + cell.y + cell.z) & 1);
  const uint placed = placeCorners(ray, cell, origin, vec3(shearX, shearY, sign_));
  Hit hits[kMaxHitsInCell];
  uint hitCount = 0;
  for (uint f = 0; f < PARAMETERS.faceCount; ++f) {
    const uint packed = PARAMETERS.faces[table + f];
    const uint places = 1u << (packed >> 11 & 31) | 1u << (packed >> 16 & 31) | 1u << (packed >> 21 & 31);
    if ((placed & places) != places) continue;
    vec3 v[3];
    for (uint corner = 0; corner < 3; ++corner) v[corner] = cornerAt(packed >> (11 + 5 * corner) & 31);
    const vec3 areas = vec3(v[1].x * v[2].y - v[1].y * v[2].x, v[2].x * v[0].y - v[2].y * v[0].x,
                            v[0].x * v[1].y - v[0].y * v[1].x);
    const float sum = areas.x + areas.y + areas.z;
    const bool inside = all(greaterThanEqual(areas, vec3(0))) || all(lessThanEqual(areas, vec3(0)));
    if (!inside || sum == 0) continue;
    const float s = dot(areas, vec3(v[0].z, v[1].z, v[2].z)) / sum;
    if (!(s >= 0 && enter + s < leave)) continue;
    const real t_ = ray.entry[ray.z] + (enter + s) * ray.step_[ray.z];
    const real t = (t_ * ray.start[3] - ray.start[ray.z]) / (ray.slope[ray.z] - t_ * ray.slope[3]);
    if (!(t > ray.near && t < ray.far)) continue;
    const ivec3 octahedron = cell + ivec3(packed & 3, packed >> 2 & 3, packed >> 4 & 3) - 1;
    const uint local = packed >> 6 & 31;
    const uint face = (ray.firstCell + octahedron.x + n * (octahedron.y + n * octahedron.z)) * kFacesPerCell + local;
    if (IS_SET(PARAMETERS.keptFaces) && (PARAMETERS.keptFaces.values[face / 32] >> face % 32 & 1) == 0) continue;
    if (kWrite) {
      uint place = min(hitCount, kMaxHitsInCell - 1);
      if (hitCount == kMaxHitsInCell && s >= hits[place].s) continue;
      for (; place > 0 && (s < hits[place - 1].s || (s == hits[place - 1].s && face < hits[place - 1].face)); --place) {
        hits[place] = hits[place - 1];
      }
      hits[place] = Hit(s, face, areas.yz / sum);
    }
    hitCount = min(hitCount + 1, kMaxHitsInCell);
  }
  if (!kWrite) {
    count = min(count + hitCount, PARAMETERS.maximum);
    return count < PARAMETERS.maximum;
  }
  for (uint i = 0; i < hitCount; ++i) {
    const uint row = ray.row + count;
    if (row < ray.endRow) {
      const realVec3 g = ray.entry + (enter + hits[i].s) * ray.step_;
      const real t = (g[ray.z] * ray.start[3] - ray.start[ray.z]) / (ray.slope[ray.z] - g[ray.z] * ray.slope[3]);
      if (IS_SET(PARAMETERS.rayOfSample)) PARAMETERS.rayOfSample.values[row] = ray.index;
      PARAMETERS.hitFaces.values[row] = hits[i].face;
      for (uint k = 0; k < 2; ++k) PARAMETERS.barycentrics.values[2 * row + k] = hits[i].barycentrics[k];
      const vec3 offset = vec3(PARAMETERS.grids[ray.grid].positionOffset[0], PARAMETERS.grids[ray.grid].positionOffset[1],
                               PARAMETERS.grids[ray.grid].positionOffset[2]);
      storePoint(PARAMETERS.positions, row,
                 clamp(vec3(g + realVec3(offset)) * PARAMETERS.grids[ray.grid].positionScale, 0, 1));
      PARAMETERS.distances.values[row] = float(t);
    }
    if (++count >= PARAMETERS.maximum) return false;
  }
  return true;
}

// Makes the ray of a grid, with the range of distances in which it has hits there.
Ray rayInGrid(uint grid, vec3 origin, vec3 direction, real near, real far) {
  Ray ray;
  ray.grid = grid;
  ray.firstCell = grid * PARAMETERS.resolution * PARAMETERS.resolution * PARAMETERS.resolution;
  for (int i = 0; i < 4; ++i) {
    ray.start[i] = PARAMETERS.grids[grid].gridFromScene[4 * i + 3];
    ray.slope[i] = 0;
    for (int axis = 0; axis < 3; ++axis) {
      ray.start[i] += real(PARAMETERS.grids[grid].gridFromScene[4 * i + axis]) * real(origin[axis]);
      ray.slope[i] += real(PARAMETERS.grids[grid].gridFromScene[4 * i + axis]) * real(direction[axis]);
    }
  }
  ray.near = near;
  ray.far = far;
  clipToGrid(ray);
  return ray;
}

// Continues a walk at s = `s`: enters the cell behind the nearest of the walls that the ray meets at `next`. Returns false
// if there is none.
bool enterNextCell(Ray ray, inout ivec3 cell, inout realVec3 next, inout real s) {
  const int n = int(PARAMETERS.resolution);
  int axis = next.y < next.x ? 1 : 0;
  if (next.z < next[axis]) axis = 2;
  s = max(s, next[axis]);
  const bool ascends = ray.step_[axis] > 0;
  cell[axis] += ascends ? 1 : -1;
  if (cell[axis] < 0 || cell[axis] >= n) return false;
  next[axis] = (cell[axis] + (ascends ? 1 : 0) - ray.entry[axis]) / ray.step_[axis];
  return true;
}

// Walks through the cells of a grid. Returns false if the ray has all hits that it may have.
bool walk(Ray ray, inout uint count) {
  const int n = int(PARAMETERS.resolution);
  real largest = 0;
  ray.z = 0;
  realVec3 along;
  for (int axis = 0; axis < 3; ++axis) {
    along[axis] = ray.slope[axis] * ray.start[3] - ray.start[axis] * ray.slope[3];
    if (abs(along[axis]) > largest) {
      largest = abs(along[axis]);
      ray.z = axis;
    }
  }
  if (!(largest > 0)) return true;
  ray.step_ = along / largest;
  ivec3 cell;
  realVec3 next;
  for (int axis = 0; axis < 3; ++axis) {
    ray.entry[axis] = clamp(coordinateAt(ray, ray.near, axis), real(0), real(n));
    cell[axis] = min(int(ray.entry[axis]), n - 1);
    // On a wall between two cells, the ray is in the one that it enters.
    if (ray.step_[axis] < 0 && cell[axis] > 0 && ray.entry[axis] == cell[axis]) --cell[axis];
    const int side = ray.step_[axis] > 0 ? 1 : 0;
    next[axis] = ray.step_[axis] == 0 ? kNever : (cell[axis] + side - ray.entry[axis]) / ray.step_[axis];
  }
  const real last = abs(coordinateAt(ray, ray.far, ray.z) - ray.entry[ray.z]);
  real s = 0;
  for (;;) {
    // Each ray goes on to its next occupied cell before any is tested against faces, so that neighbouring invocations
    // do so together.
    real leave = min(min(next.x, next.y), next.z);
    bool occupied = isOccupied(ray.grid, cell);
    while (!occupied && leave < last) {
      if (!enterNextCell(ray, cell, next, s)) return true;
      leave = min(min(next.x, next.y), next.z);
      occupied = isOccupied(ray.grid, cell);
    }
    if (occupied && !addHits(ray, cell, s, leave, count)) return false;
    if (!(leave < last) || !enterNextCell(ray, cell, next, s)) return true;
  }
}

// Returns the number of hits of a ray.
uint trace(uint index, uint row, uint endRow) {
  const vec3 origin = pointAt(PARAMETERS.origins, index), direction = pointAt(PARAMETERS.directions, index);
  if (direction == vec3(0) || PARAMETERS.maximum == 0) return 0;
  const real near = max(real(PARAMETERS.near), distanceBehindBox(origin, direction));
  real far = kNever;
  if (IS_SET(PARAMETERS.farOfRay)) far = min(far, real(PARAMETERS.farOfRay.values[index]));
  // The boxes of the grids are convex and do not overlap, so that a ray crosses them one after another.
  uint count = 0;
  uint walked = 0;  // bits of grids
  for (uint turn = 0; turn < PARAMETERS.gridCount; ++turn) {
    real nearest = kNever;
    Ray ray;
    for (uint grid = 0; grid < PARAMETERS.gridCount; ++grid) {
      if ((walked >> grid & 1) != 0) continue;
      const Ray other = rayInGrid(grid, origin, direction, near, far);
      if (!(other.near < other.far && other.near < nearest)) continue;
      nearest = other.near;
      ray = other;
    }
    if (!(nearest < kNever)) break;
    walked |= 1u << ray.grid;
    ray.index = index;
    ray.row = row;
    ray.endRow = endRow;
    if (!walk(ray, count)) break;
  }
  return count;
}

void storeNothing(uint ray, uint row) {
  if (IS_SET(PARAMETERS.rayOfSample)) PARAMETERS.rayOfSample.values[row] = ray;
  PARAMETERS.hitFaces.values[row] = 0;
  for (uint k = 0; k < 2; ++k) PARAMETERS.barycentrics.values[2 * row + k] = 0;
  storePoint(PARAMETERS.positions, row, vec3(0));
  PARAMETERS.distances.values[row] = 0;
}

void main() {
  if (!kWrite) {
    FOR_EACH_ROW(ray, PARAMETERS.rays) { PARAMETERS.counts.values[ray] = trace(ray, 0, 0); }
    return;
  }
  const uint fitting = PARAMETERS.fitting.values[0];
  if (gl_GlobalInvocationID.x == 0) {
    PARAMETERS.firstSample.values[0] = 0;
    if (IS_SET(PARAMETERS.finishedRays)) PARAMETERS.finishedRays.values[0] = fitting;
  }
  FOR_EACH_ROW(ray, PARAMETERS.rays) {
    const bool fits = ray < fitting;
    const uint first = ray == 0 ? 0 : PARAMETERS.counts.values[ray - 1], end = PARAMETERS.counts.values[ray];
    PARAMETERS.firstSample.values[ray + 1] = fits ? end : PARAMETERS.sampleCount.values[0];
    if (!fits || end == first) continue;
    // Fills the rows that were counted but not written, because the second run rounded differently.
    for (uint row = first + trace(ray, first, end); row < end; ++row) storeNothing(ray, row);
  }
}

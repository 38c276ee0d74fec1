// MarchBlocks: one invocation per ray, run twice like march_rays.comp. Empty cells are skipped by whole steps, so the
// samples are those of a march without skipping.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "kernel.glsl"
#include "arguments_blocks.h"
#include "real.glsl"
#include "block_space.glsl"
#include "domain_pieces.glsl"
#include "vectors.glsl"

layout(local_size_x = 64) in;
layout(constant_id = 0) const bool kWrite = false;
KERNEL_ARGUMENTS(MarchBlocksArguments)

const uint kThrough = 0xffffffffu, kNoSlot = 0xffffffffu;
const real kLongestStep = real(1e3);

struct Ray {
  uint index;
  realVec3 origin, direction;
  real jitter, far;
  uint first;  // the interval to continue from
  uint row, endRow;  // rows of its samples: none is written beyond, even if the second run rounds differently
};

struct State {
  uint samples, number;  // samples so far; intervals of the pieces in front
  real before;           // length of the pieces in front
  uint next;             // the interval to continue from
  bool done;
};

void store(MarchBlocksArguments a, Ray ray, uint row, uint slot, DomainPiece s, realVec3 position, real before,
           real begin, real end) {
  const real middle = (begin + end) / 2, distance = alongPiece(s, begin);
  const real inScene = min(min(alongPieceBetween(s, begin, end), ray.far - distance), kLongestStep);
  a.march.rayOfSample.values[row] = ray.index;
  a.slotOfSample.values[row] = slot;
  storePoint(a.march.positions, row, vec3(position));
  a.march.distances.values[row] = float(alongPiece(s, middle));
  a.march.steps.values[row] = float(inScene);
  a.middles.values[row] = float(before + middle);
  a.widths.values[row] = float(end - begin);
}

void storeNothing(MarchBlocksArguments a, Ray ray, uint row) {
  a.march.rayOfSample.values[row] = ray.index;
  a.slotOfSample.values[row] = 0;
  storePoint(a.march.positions, row, vec3(0));
  a.march.distances.values[row] = a.march.steps.values[row] = a.middles.values[row] = a.widths.values[row] = 0;
}

// Marches the intervals [from, count) of a piece.
void marchPiece(MarchBlocksArguments a, Ray ray, DomainPiece s, real all, uint slot, uint from, uint count,
                inout State state) {
  const real stride = a.step * 2 * all;
  const uint firstWord = slot * (a.cells * a.cells * a.cells / 32);
  for (uint i = from; i < count;) {
    const real begin = max(real(0), (real(i) - 1 + ray.jitter) * stride);
    const real end = min(s.whole, (real(i) + ray.jitter) * stride), middle = (begin + end) / 2;
    const realVec3 position = clamp((s.start + middle * s.direction + all) / (2 * all), real(0), real(1));
    const uvec3 cell = min(uvec3(position * real(a.cells)), uvec3(a.cells - 1));
    const uint bit = cell.x + a.cells * (cell.y + a.cells * cell.z);
    if ((a.march.occupancy.values[firstWord + bit / 32] >> bit % 32 & 1) == 0) {
      // Skips to the first interval whose middle is past the empty cell; the tolerance costs at most one more lookup.
      real exit = s.whole;
      for (int axis = 0; axis < 3; ++axis) {
        const real d = s.direction[axis];
        if (d == 0) continue;
        const real face = (real(cell[axis]) + (d > 0 ? 1 : 0)) / a.cells * 2 * all - all;
        exit = min(exit, (face - s.start[axis]) / d);
      }
      const real passed = floor((exit - kRoundingShare) / stride + real(0.5) - ray.jitter);
      i = max(i + 1, uint(clamp(passed, real(0), real(count))));
      continue;
    }
    if (alongPiece(s, begin) >= ray.far) return;
    if (kWrite && ray.row + state.samples < ray.endRow) {
      store(a, ray, ray.row + state.samples, slot, s, position, state.before, begin, end);
    }
    ++i;
    if (++state.samples == a.march.maximum) {
      state.next = state.number + i;
      state.done = true;
      return;
    }
  }
}

// Returns the number of intervals that begin within a piece: the first, and those at (i - 1 + jitter) steps.
uint countIntervals(Ray ray, real whole, real stride) {
  uint count = uint(max(real(1), ceil(whole / stride + 1 - ray.jitter)));
  while (count > 1 && (real(count) - 2 + ray.jitter) * stride >= whole) --count;
  while ((real(count) - 1 + ray.jitter) * stride < whole) ++count;
  return count;
}

// Marches the ray between two distances within one block.
void marchRange(MarchBlocksArguments a, Ray ray, real near, real far, inout State state) {
  const real middle = (near + far) / 2;
  const uint block = blockAt(a.space, ray.origin + middle * ray.direction);
  const Placement placement = computePlacement(a.space, block);
  if (!placement.contracted) {  // along x and y it is bounded by walls
    const real o = ray.origin.z - placement.centre.z, d = ray.direction.z;
    if (d == 0) {
      if (abs(o) > 1) return;
    } else {
      near = max(near, min((-1 - o) / d, (1 - o) / d));
      far = min(far, max((-1 - o) / d, (1 - o) / d));
    }
  }
  if (!(near < far)) return;
  const uint slot = IS_SET(a.slotOfBlock) ? a.slotOfBlock.values[block] : block;
  const real all = placement.halfDomain;
  DomainPieces pieces = makePieces(placement, ray.origin, ray.direction, near, far);
  DomainPiece piece;
  while (!state.done && nextPiece(pieces, placement.contracted, piece)) {
    if (piece.entry >= ray.far) {
      state.done = true;
      return;
    }
    const uint count = countIntervals(ray, piece.whole, a.step * 2 * all);
    if (slot != kNoSlot && ray.first < state.number + count) {
      const uint from = ray.first > state.number ? ray.first - state.number : 0;
      marchPiece(a, ray, piece, all, slot, from, count, state);
    }
    state.number += count;
    state.before += piece.whole;
  }
}

State march(MarchBlocksArguments a, Ray ray) {
  State state = State(0, 0, real(0), kThrough, false);
  real near = a.space.near;
  if (IS_SET(a.nearOfRay)) near = max(near, real(a.nearOfRay.values[ray.index]));
  const Range box = rangeInBox(a.space, ray.origin, ray.direction, near);
  const bool empty = isEmpty(box), own = a.space.backgroundBlock == kBackgroundBlockOwn;
  if (!empty) near = box.near;
  // The ray belongs to the cells up to this distance.
  real walled = own || a.space.backgroundBlock == kBackgroundBlockNone ? box.far : kFarthest;
  if (empty && a.space.backgroundBlock != kBackgroundBlockBorder) walled = near;
  WallWalk walk = makeWallWalk(a.space, ray.direction);
  real from = near;
  for (real to = nextWall(a.space, ray.origin, ray.direction, walk); !state.done;
       to = nextWall(a.space, ray.origin, ray.direction, walk)) {
    const bool last = !(to < walled);
    if (last) to = walled;
    if (from < to) {
      marchRange(a, ray, from, to, state);
      from = to;
    }
    if (last) break;
  }
  if (own && !state.done && from < kFarthest) marchRange(a, ray, from, kFarthest, state);
  return state;
}

Ray rayAt(MarchBlocksArguments a, uint index) {
  Ray ray;
  ray.index = index;
  ray.origin = realVec3(pointAt(a.march.origins, index));
  ray.direction = realVec3(pointAt(a.march.directions, index));
  ray.jitter = IS_SET(a.march.jitter) ? real(a.march.jitter.values[index]) : real(1);
  ray.far = IS_SET(a.march.farOfRay) ? real(a.march.farOfRay.values[index]) : kNever;
  ray.first = IS_SET(a.march.nextStep) ? a.march.nextStep.values[index] : 0;
  ray.row = ray.endRow = 0;
  return ray;
}

void main() {
  MarchBlocksArguments a = arguments.values;
  if (!kWrite) {
    FOR_EACH_ROW(index, a.march.rays) {
      const Ray ray = rayAt(a, index);
      const bool opaque = IS_SET(a.march.opticalDepth) && a.march.opticalDepth.values[index] > a.march.maxOpticalDepth;
      const bool waits = opaque || a.march.maximum == 0 || ray.first == kThrough;
      State state = State(0, 0, real(0), waits ? ray.first : kThrough, true);
      if (!waits && ray.direction != realVec3(0)) state = march(a, ray);
      a.march.counts.values[index] = state.samples;
      a.march.nexts.values[index] = state.next;
    }
    return;
  }
  const uint fitting = a.march.fitting.values[0];
  if (gl_GlobalInvocationID.x == 0) {
    a.march.firstSample.values[0] = 0;
    if (IS_SET(a.march.finishedRays)) a.march.finishedRays.values[0] = fitting;
  }
  FOR_EACH_ROW(index, a.march.rays) {
    const bool fits = index < fitting;
    const uint first = index == 0 ? 0 : a.march.counts.values[index - 1], end = a.march.counts.values[index];
    a.march.firstSample.values[index + 1] = fits ? end : a.march.sampleCount.values[0];
    if (!fits) continue;
    Ray ray = rayAt(a, index);
    ray.row = first;
    ray.endRow = end;
    if (end > first) {
      // Fills the rows that were counted but not written, because the second run rounded differently.
      for (uint row = first + march(a, ray).samples; row < end; ++row) storeNothing(a, ray, row);
    }
    if (IS_SET(a.march.nextStep)) a.march.nextStep.values[index] = a.march.nexts.values[index];
  }
}

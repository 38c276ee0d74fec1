// One invocation a ray. With kSplit run twice: first samples and segments are counted, then, when it is known where each
// ray's begin, they are written.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "kernel.glsl"
#include "arguments_blocks.h"
#include "real.glsl"
#include "block_space.glsl"
#include "vectors.glsl"

layout(local_size_x = 64) in;
layout(constant_id = 0) const bool kWrite = false;
layout(constant_id = 1) const bool kSplit = false;
KERNEL_ARGUMENTS(BlockSamplesArguments)

const uint kNoSlot = 0xffffffffu;

struct Ray {
  uint index;
  realVec3 origin, direction;
  Range range;
  real farthest;
  uint endRow, endSegment;  // nothing is written beyond, whatever a driver rounds otherwise in the second run
};

struct Made {
  uint samples, segments;
  uint group;  // of the last segment
};

struct Post {
  real s, t;
};

void store(BlockSamplesArguments a, Ray ray, uint row, Post from, Post to, uint block, bool held) {
  const real middle = (from.t + to.t) / 2;
  const realVec3 x = ray.origin + middle * ray.direction;
  const Placement placement = placementOf(a.space, block);
  const realVec3 q = (x - placement.centre) / placement.scale, y = placement.contracted ? contracted(q) : q;
  const real all = placement.halfDomain;
  const bool inside = abs(y.x) <= all && abs(y.y) <= all && abs(y.z) <= all;
  real inScene = 0;
  if (held && inside && ray.direction != realVec3(0)) {
    inScene = max(real(0), min(to.t, ray.farthest) - min(from.t, ray.farthest));
  }
  storePoint(a.positions, row, vec3(clamp((y + all) / (2 * all), real(0), real(1))));
  a.distances.values[row] = float(middle);
  a.steps.values[row] = float(inScene);
  if (WANTED(a.middles)) a.middles.values[row] = float((from.s + to.s) / 2);
  if (WANTED(a.widths)) a.widths.values[row] = float(to.s - from.s);
  if (WANTED(a.runtimeSteps)) {
    a.runtimeSteps.values[row] = float(runtimeStepAt(placement, a.texels, q, ray.direction));
  }
}

// One more sample of the ray, between two posts.
void add(BlockSamplesArguments a, Ray ray, uint firstRow, uint firstSegment, Post from, Post to, inout Made made) {
  const uint block = blockAt(a.space, ray.origin + (from.t + to.t) / 2 * ray.direction);
  uint slot = WANTED(a.slotOfBlock) ? a.slotOfBlock.values[block] : block;
  const bool held = slot != kNoSlot;
  if (!held) slot = 0;
  const uint row = firstRow + made.samples;
  if (kSplit) {
    const uint group = WANTED(a.groupOfBlock) ? a.groupOfBlock.values[slot] : slot;
    if (made.samples == 0 || group != made.group) {
      const uint segment = firstSegment + made.segments;
      if (kWrite && segment < ray.endSegment) {
        a.firstSampleOfSegment.values[segment] = min(row, ray.endRow);
        a.groupOfSegment.values[segment] = group;
        a.rayOfSegment.values[segment] = ray.index;
      }
      ++made.segments;
      made.group = group;
    }
  }
  if (kWrite && row < ray.endRow) {
    a.blockOfSample.values[row] = slot;
    store(a, ray, row, from, to, block, held);
  }
  ++made.samples;
}

// Where a ray may be cut next: at walls, and where it leaves the box before an own surround.
struct Cuts {
  WallWalk walk;
  real wall, exit;
};

Post nextCut(BlockSamplesArguments a, Ray ray, inout Cuts cuts) {
  Post post;
  post.t = min(cuts.wall, cuts.exit);
  post.s = post.t < kNever ? shareAt(a.space, post.t, ray.range) : real(2);
  if (cuts.wall <= cuts.exit) {
    cuts.wall = nextWall(a.space, ray.origin, ray.direction, cuts.walk);
  } else {
    cuts.exit = kNever;
  }
  return post;
}

Made samplesOf(BlockSamplesArguments a, Ray ray, uint firstRow, uint firstSegment) {
  Made made = Made(0, 0, 0);
  const uint firstPost = ray.index * (a.intervals + 1);
  Post from, cut;
  from.s = a.fences.values[firstPost];
  from.t = alongShare(a.space, from.s, ray.range);
  Cuts cuts;
  cut.s = 2;
  if (kSplit && ray.direction != realVec3(0)) {
    cuts.walk = wallWalkOf(a.space, ray.direction);
    cuts.wall = nextWall(a.space, ray.origin, ray.direction, cuts.walk);
    cuts.exit = a.space.surround == kSurroundOwn ? ray.range.far : kNever;
    cut = nextCut(a, ray, cuts);
  }
  for (uint i = 1; i <= a.intervals; ++i) {
    Post to;
    to.s = a.fences.values[firstPost + i];
    to.t = alongShare(a.space, to.s, ray.range);
    while (cut.s < to.s) {
      if (cut.s > from.s) {
        add(a, ray, firstRow, firstSegment, from, cut, made);
        from = cut;
      }
      cut = nextCut(a, ray, cuts);
    }
    add(a, ray, firstRow, firstSegment, from, to, made);
    from = to;
  }
  return made;
}

// Whatever a driver rounds otherwise in the second run: each row and segment that was counted is written.
void closeRows(BlockSamplesArguments a, Ray ray, uint row, uint segment) {
  for (; row < ray.endRow; ++row) {
    a.blockOfSample.values[row] = 0;
    storePoint(a.positions, row, vec3(0));
    a.distances.values[row] = a.steps.values[row] = 0;
    if (WANTED(a.middles)) a.middles.values[row] = 0;
    if (WANTED(a.widths)) a.widths.values[row] = 0;
    if (WANTED(a.runtimeSteps)) a.runtimeSteps.values[row] = 0;
  }
  for (; segment < ray.endSegment; ++segment) {
    a.firstSampleOfSegment.values[segment] = ray.endRow;
    a.groupOfSegment.values[segment] = 0;
    a.rayOfSegment.values[segment] = ray.index;
  }
}

Ray rayAt(BlockSamplesArguments a, uint index) {
  Ray ray;
  ray.index = index;
  ray.endRow = ray.endSegment = 0;
  ray.origin = realVec3(pointAt(a.origins, index));
  ray.direction = realVec3(pointAt(a.directions, index));
  ray.range = Range(a.range.values[2 * index], a.range.values[2 * index + 1]);
  ray.farthest = WANTED(a.farOfRay) ? real(a.farOfRay.values[index]) : kNever;
  return ray;
}

void main() {
  BlockSamplesArguments a = arguments.values;
  const uint rays = endOf(a.rays);
  if (!kWrite) {
    FOR_EACH(index, rays) {
      const Made made = samplesOf(a, rayAt(a, index), 0, 0);
      a.sampleCounts.values[index] = made.samples;
      a.segmentCounts.values[index] = made.segments;
    }
    return;
  }
  FOR_EACH(index, rays + 1) {  // the last only ends what the others began
    uint firstRow = a.firstRow + index * a.intervals, firstSegment = 0;
    if (kSplit) {
      firstRow = a.firstRow + (index == 0 ? 0 : a.sampleCounts.values[index - 1]);
      firstSegment = index == 0 ? 0 : a.segmentCounts.values[index - 1];
      a.firstSegment.values[index] = firstSegment;
    }
    a.firstSample.values[index] = firstRow;
    if (index < rays) {
      Ray ray = rayAt(a, index);
      ray.endRow = kSplit ? a.firstRow + a.sampleCounts.values[index] : firstRow + a.intervals;
      ray.endSegment = kSplit ? a.segmentCounts.values[index] : 0;
      const Made made = samplesOf(a, ray, firstRow, firstSegment);
      closeRows(a, ray, firstRow + made.samples, firstSegment + made.segments);
      continue;
    }
    a.rowCount.values[0] = firstRow;
    if (!kSplit) continue;
    a.segmentCount.values[0] = firstSegment;
    a.firstSampleOfSegment.values[firstSegment] = firstRow;
  }
}

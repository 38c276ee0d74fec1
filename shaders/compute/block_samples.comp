// BlockSamples: one invocation per ray. With kSplit, the kernel runs twice: it counts samples and segments, and after
// their prefix sums are known, writes them.
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
  uint endRow, endSegment;  // nothing is written beyond, even if the second run rounds differently
};

struct Progress {
  uint samples, segments;
  uint group;  // of the last segment
};

struct Post {
  real s, t;
};

void store(BlockSamplesArguments a, Ray ray, uint row, Post from, Post to, uint block, bool hasSlot) {
  const real middle = (from.t + to.t) / 2;
  const realVec3 x = ray.origin + middle * ray.direction;
  const Placement placement = computePlacement(a.space, block);
  const realVec3 q = (x - placement.centre) / placement.scale, y = placement.contracted ? contracted(q) : q;
  const real all = placement.halfDomain;
  const bool inside = abs(y.x) <= all && abs(y.y) <= all && abs(y.z) <= all;
  real inScene = 0;
  if (hasSlot && inside && ray.direction != realVec3(0)) {
    inScene = max(real(0), min(to.t, ray.farthest) - min(from.t, ray.farthest));
  }
  storePoint(a.positions, row, vec3(clamp((y + all) / (2 * all), real(0), real(1))));
  a.distances.values[row] = float(middle);
  a.steps.values[row] = float(inScene);
  if (IS_SET(a.middles)) a.middles.values[row] = float((from.s + to.s) / 2);
  if (IS_SET(a.widths)) a.widths.values[row] = float(to.s - from.s);
  if (IS_SET(a.runtimeSteps)) {
    a.runtimeSteps.values[row] = float(runtimeStepAt(placement, a.texels, q, ray.direction));
  }
}

// Adds a sample of the ray between two fence posts.
void add(BlockSamplesArguments a, Ray ray, uint firstRow, uint firstSegment, Post from, Post to, inout Progress progress) {
  const uint block = blockAt(a.space, ray.origin + (from.t + to.t) / 2 * ray.direction);
  uint slot = IS_SET(a.slotOfBlock) ? a.slotOfBlock.values[block] : block;
  const bool hasSlot = slot != kNoSlot;
  if (!hasSlot) slot = 0;
  const uint row = firstRow + progress.samples;
  if (kSplit) {
    const uint group = IS_SET(a.groupOfBlock) ? a.groupOfBlock.values[slot] : slot;
    if (progress.samples == 0 || group != progress.group) {
      const uint segment = firstSegment + progress.segments;
      if (kWrite && segment < ray.endSegment) {
        a.firstSampleOfSegment.values[segment] = min(row, ray.endRow);
        a.groupOfSegment.values[segment] = group;
        a.rayOfSegment.values[segment] = ray.index;
      }
      ++progress.segments;
      progress.group = group;
    }
  }
  if (kWrite && row < ray.endRow) {
    a.blockOfSample.values[row] = slot;
    store(a, ray, row, from, to, block, hasSlot);
  }
  ++progress.samples;
}

// The next places where a ray may be cut: at walls, and where it leaves the box if the background has its own block.
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

Progress generateSamples(BlockSamplesArguments a, Ray ray, uint firstRow, uint firstSegment) {
  Progress progress = Progress(0, 0, 0);
  const uint firstPost = ray.index * (a.intervals + 1);
  Post from, cut;
  from.s = a.fences.values[firstPost];
  from.t = alongShare(a.space, from.s, ray.range);
  Cuts cuts;
  cut.s = 2;
  if (kSplit && ray.direction != realVec3(0)) {
    cuts.walk = makeWallWalk(a.space, ray.direction);
    cuts.wall = nextWall(a.space, ray.origin, ray.direction, cuts.walk);
    cuts.exit = a.space.backgroundBlock == kBackgroundBlockOwn ? ray.range.far : kNever;
    cut = nextCut(a, ray, cuts);
  }
  for (uint i = 1; i <= a.intervals; ++i) {
    Post to;
    to.s = a.fences.values[firstPost + i];
    to.t = alongShare(a.space, to.s, ray.range);
    while (cut.s < to.s) {
      if (cut.s > from.s) {
        add(a, ray, firstRow, firstSegment, from, cut, progress);
        from = cut;
      }
      cut = nextCut(a, ray, cuts);
    }
    add(a, ray, firstRow, firstSegment, from, to, progress);
    from = to;
  }
  return progress;
}

// Fills the rows and segments that were counted but not written, because the second run rounded differently.
void closeRows(BlockSamplesArguments a, Ray ray, uint row, uint segment) {
  for (; row < ray.endRow; ++row) {
    a.blockOfSample.values[row] = 0;
    storePoint(a.positions, row, vec3(0));
    a.distances.values[row] = a.steps.values[row] = 0;
    if (IS_SET(a.middles)) a.middles.values[row] = 0;
    if (IS_SET(a.widths)) a.widths.values[row] = 0;
    if (IS_SET(a.runtimeSteps)) a.runtimeSteps.values[row] = 0;
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
  ray.farthest = IS_SET(a.farOfRay) ? real(a.farOfRay.values[index]) : kNever;
  return ray;
}

void main() {
  BlockSamplesArguments a = arguments.values;
  const uint rays = rowRangeEnd(a.rays);
  if (!kWrite) {
    FOR_EACH(index, rays) {
      const Progress progress = generateSamples(a, rayAt(a, index), 0, 0);
      a.sampleCounts.values[index] = progress.samples;
      a.segmentCounts.values[index] = progress.segments;
    }
    return;
  }
  FOR_EACH(index, rays + 1) {  // the last invocation only writes the ends
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
      const Progress progress = generateSamples(a, ray, firstRow, firstSegment);
      closeRows(a, ray, firstRow + progress.samples, firstSegment + progress.segments);
      continue;
    }
    a.rowCount.values[0] = firstRow;
    if (!kSplit) continue;
    a.segmentCount.values[0] = firstSegment;
    a.firstSampleOfSegment.values[firstSegment] = firstRow;
  }
}

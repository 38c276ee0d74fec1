// MarchRays: one invocation per ray. The kernel runs twice: it counts samples, and after their prefix sums are known,
// generates them again and writes them. Empty cells are skipped by whole steps, so the samples are those of a march
// without skipping.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "kernel.glsl"
#include "arguments_rays.h"
#include "real.glsl"
#include "march_space.glsl"
#include "vectors.glsl"

layout(local_size_x = 64) in;
layout(constant_id = 0) const bool kWrite = false;
KERNEL_ARGUMENTS(MarchRaysArguments)

const uint kThrough = 0xffffffffu;
const uint kMaxIndex = 1u << 30;

struct Round {
  uint samples;
  uint next;  // the step index to continue from
};

bool isOccupied(MarchRaysArguments a, ivec3 cell) {
  const uint i = cell.x + a.space.resolution * (cell.y + a.space.resolution * cell.z);
  return (a.march.occupancy.values[i / 32] >> i % 32 & 1) != 0;
}

void store(MarchRaysArguments a, uint ray, uint row, realVec3 u, real middle, real length_) {
  if (IS_SET(a.march.rayOfSample)) a.march.rayOfSample.values[row] = ray;
  storePoint(a.march.positions, row, clamp(vec3(u), 0, 1));
  a.march.distances.values[row] = float(middle);
  a.march.steps.values[row] = float(length_);
}

// Computes the range [enter, leave] in which the ray is inside a bounded space; empty if it never is.
void clipToCube(realVec3 o, realVec3 d, out real enter, out real leave) {
  enter = 0;
  leave = real(1e30);
  for (int axis = 0; axis < 3; ++axis) {
    if (d[axis] == 0) {
      if (abs(o[axis]) > 1) leave = 0;
      continue;
    }
    const real t0 = (-1 - o[axis]) / d[axis], t1 = (1 - o[axis]) / d[axis];
    enter = max(enter, min(t0, t1));
    leave = min(leave, max(t0, t1));
  }
}

// Generates the ray's next samples. With kWrite they are written to the rows [row, endRow) only: the driver may have
// compiled both runs with different rounding.
Round march(MarchRaysArguments a, uint ray, uint row, uint endRow) {
  const uint from = IS_SET(a.march.nextStep) ? a.march.nextStep.values[ray] : 0;
  const bool opaque = IS_SET(a.march.opticalDepth) && a.march.opticalDepth.values[ray] > a.march.maxOpticalDepth;
  if (from == kThrough || opaque || a.march.maximum == 0) return Round(0, from);
  const realVec3 o = realVec3(pointAt(a.march.origins, ray)), d = realVec3(pointAt(a.march.directions, ray));
  Round result = Round(0, kThrough);
  if (d == realVec3(0)) return result;
  const real jitter = IS_SET(a.march.jitter) ? a.march.jitter.values[ray] : 0;
  real far = a.space.far;
  if (IS_SET(a.march.farOfRay)) far = min(far, real(a.march.farOfRay.values[ray]));
  real k = ceil(unpackReal(a.space.firstIndex) - jitter);
  if (a.space.contracted == 0) {
    real enter, leave;
    clipToCube(o, d, enter, leave);
    if (!(enter < leave)) return result;
    far = min(far, leave * (1 + real(1e-6)) + real(1e-6));
    k = max(k, floor(stepIndexAt(a.space, enter) - jitter) - 1);
  }
  k = max(max(k, real(0)), real(min(from, kMaxIndex)));
  real begin = distanceAt(a.space, k + jitter);
  for (;;) {
    const real end = distanceAt(a.space, k + 1 + jitter), middle = (begin + end) / 2;
    if (!(middle < far && end > begin)) return result;
    const Cell cell = cellAt(a.space, o + middle * d);
    const real length_ = end - begin;
    k += 1;
    begin = end;
    if (cell.inside && isOccupied(a, cell.index)) {
      if (kWrite && row + result.samples < endRow) store(a, ray, row + result.samples, cell.u, middle, length_);
      if (++result.samples < a.march.maximum) continue;
      result.next = uint(k);
      return result;
    }
    if (!cell.inside) continue;
    // Skips to the first step whose middle is past the empty cell; the tolerance costs at most one more lookup.
    const real exit = exitDistance(a.space, cell, o, d, middle) * (1 - kRoundingShare);
    if (exit >= far) return result;
    if (exit > begin + 4 * (end - middle)) {
      k = max(k, floor(stepIndexAt(a.space, exit) - jitter) - 1);
      begin = distanceAt(a.space, k + jitter);
    }
    for (real next = distanceAt(a.space, k + 1 + jitter); (begin + next) / 2 < exit && next > begin;
         next = distanceAt(a.space, k + 1 + jitter)) {
      k += 1;
      begin = next;
    }
  }
}

void main() {
  MarchRaysArguments a = arguments.values;
  if (!kWrite) {
    FOR_EACH_ROW(ray, a.march.rays) {
      const Round result = march(a, ray, 0, 0);
      a.march.counts.values[ray] = result.samples;
      a.march.nexts.values[ray] = result.next;
    }
    return;
  }
  const uint fitting = a.march.fitting.values[0];
  if (gl_GlobalInvocationID.x == 0) {
    a.march.firstSample.values[0] = 0;
    if (IS_SET(a.march.finishedRays)) a.march.finishedRays.values[0] = fitting;
  }
  FOR_EACH_ROW(ray, a.march.rays) {
    const bool fits = ray < fitting;
    const uint first = ray == 0 ? 0 : a.march.counts.values[ray - 1], end = a.march.counts.values[ray];
    a.march.firstSample.values[ray + 1] = fits ? end : a.march.sampleCount.values[0];
    if (!fits) continue;
    if (end > first) {
      // Fills the rows that were counted but not written, because the second run rounded differently.
      for (uint row = first + march(a, ray, first, end).samples; row < end; ++row) store(a, ray, row, realVec3(0), 0, 0);
    }
    if (IS_SET(a.march.nextStep)) a.march.nextStep.values[ray] = a.march.nexts.values[ray];
  }
}

#include "compute/block_march.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <vector>

#include "compute/block_path.h"
#include "compute/cpu/kernels.h"
#include "compute/cpu/offsets.h"
#include "compute/host_memory.h"

namespace tessera::cpu {
namespace {

constexpr size_t kRaysPerTask = 64;  // fixed; the samples of all tasks are concatenated in task order

struct Sample {
  uint32_t ray, slot;
  float position[3];
  float distance, step, middle, width;
};

struct Marcher {
  const MarchBlocks& a;
  const uint32_t* slots = hostPointer(a.slotOfBlock);
  const uint32_t* occupancy = hostPointer(a.occupancy);
  const size_t words = size_t{a.cells} * a.cells * a.cells / 32;
  std::vector<BlockPiece> pieces = {};  // of one ray

  // Adds the next samples of the ray; returns the interval from which to continue.
  uint32_t march(uint32_t ray, std::vector<Sample>& samples) {
    const uint32_t first = a.nextStep ? hostPointer(a.nextStep)[ray] : 0;
    if (first == MarchBlocks::kThrough || a.maximum == 0) return first;
    if (a.opticalDepth && hostPointer(a.opticalDepth)[ray] > a.maxOpticalDepth) return first;
    Triple<double> origin, direction;
    for (int axis = 0; axis < 3; ++axis) {
      origin[axis] = hostPointer(a.origins)[3 * ray + axis];
      direction[axis] = hostPointer(a.directions)[3 * ray + axis];
    }
    const double jitter = a.jitter ? hostPointer(a.jitter)[ray] : 1;
    const double far = a.farOfRay ? hostPointer(a.farOfRay)[ray] : std::numeric_limits<double>::infinity();
    blockPath(a.space, origin, direction, a.nearOfRay ? hostPointer(a.nearOfRay)[ray] : 0, pieces);
    const size_t maximum = a.maximum == 0xffffffffu ? samples.max_size() : samples.size() + a.maximum;
    double before = 0;    // total length of the pieces in front
    uint32_t number = 0;  // number of the first interval of the piece
    for (const BlockPiece& piece : pieces) {
      const DomainSegment& s = piece.segment;
      if (s.entry >= far) return MarchBlocks::kThrough;
      const double half = makeBlockDomain(a.space.placement(piece.block)).half(), step = a.step * 2 * half;
      // Interval i > 0 begins at (i - 1 + jitter) step. Counts the first interval and all that begin inside the piece;
      // the loops correct for rounding.
      uint32_t count = static_cast<uint32_t>(std::max(1.0, std::ceil(s.length / step + 1 - jitter)));
      while (count > 1 && (static_cast<double>(count) - 2 + jitter) * step >= s.length) --count;
      while ((static_cast<double>(count) - 1 + jitter) * step < s.length) ++count;
      const uint32_t slot = slots != nullptr ? slots[piece.block] : piece.block;
      if (slot != kNoSlot && first < number + count) {
        const uint32_t from = first > number ? first - number : 0;
        const uint32_t next =
            marchPiece({s, half, step, before, slot}, jitter, far, from, count, ray, maximum, samples);
        if (samples.size() == maximum) return number + next;
      }
      number += count;
      before += s.length;
    }
    return MarchBlocks::kThrough;
  }

  struct Piece {
    const DomainSegment& s;
    double half, step, before;
    uint32_t slot;
  };
  // Samples the intervals [from, count) of a piece; returns the interval from which to continue.
  uint32_t marchPiece(const Piece& piece, double jitter, double far, uint32_t from, uint32_t count, uint32_t ray,
                      size_t maximum, std::vector<Sample>& samples) const {
    const DomainSegment& s = piece.s;
    const double half = piece.half, step = piece.step;
    const uint32_t* bits = occupancy + piece.slot * words;
    const double cells = a.cells;
    for (uint32_t i = from; i < count;) {
      const double begin = std::max(0.0, (static_cast<double>(i) - 1 + jitter) * step);
      const double end = std::min(s.length, (static_cast<double>(i) + jitter) * step), middle = 0.5 * (begin + end);
      double position[3];
      size_t index[3];
      for (int axis = 0; axis < 3; ++axis) {
        position[axis] = std::clamp((s.start[axis] + middle * s.direction[axis] + half) / (2 * half), 0.0, 1.0);
        index[axis] = std::min(static_cast<size_t>(position[axis] * cells), size_t{a.cells} - 1);
      }
      const size_t cell = index[0] + a.cells * (index[1] + a.cells * index[2]);
      if ((bits[cell / 32] >> cell % 32 & 1) == 0) {
        // Skips whole intervals up to the first whose middle is behind the empty cell; because of the tolerance, one
        // more interval may be visited.
        double exit = s.length;
        for (int axis = 0; axis < 3; ++axis) {
          const double d = s.direction[axis];
          if (d == 0) continue;
          const double face = (static_cast<double>(index[axis]) + (d > 0 ? 1 : 0)) / cells * 2 * half - half;
          exit = std::min(exit, (face - s.start[axis]) / d);
        }
        const double passed = std::floor((exit - 1e-9) / step + 0.5 - jitter);  // middles at (i - ½ + jitter) step
        i = std::max(i + 1, static_cast<uint32_t>(std::clamp(passed, 0.0, static_cast<double>(count))));
        continue;
      }
      const double distance = s.distanceAt(begin);
      if (distance >= far) return i;
      ++i;
      Sample sample;
      sample.ray = ray;
      sample.slot = piece.slot;
      for (int axis = 0; axis < 3; ++axis) sample.position[axis] = static_cast<float>(position[axis]);
      sample.distance = static_cast<float>(s.distanceAt(middle));
      sample.step =
          static_cast<float>(std::min({s.distanceBetween(begin, end), far - distance, MarchBlocks::kLongestStep}));
      sample.middle = static_cast<float>(piece.before + middle);
      sample.width = static_cast<float>(end - begin);
      samples.push_back(sample);
      if (samples.size() == maximum) return i;
    }
    return count;
  }
};

}  // namespace

void run(Context& context, const MarchBlocks& a) {
  const uint32_t rays = hostCount(a.rays);
  const size_t tasks = (rays + kRaysPerTask - 1) / kRaysPerTask;
  uint32_t* firstSample = hostPointer(a.firstSample);
  std::vector<std::vector<Sample>> samplesOfTask(tasks);
  std::vector<uint32_t> nextStep(rays);
  context.pool.run(tasks, [&](size_t task, int) {
    std::vector<Sample>& samples = samplesOfTask[task];
    samples.reserve(kRaysPerTask * 32);
    Marcher marcher{a};
    for (size_t ray = task * kRaysPerTask; ray < std::min<size_t>(rays, (task + 1) * kRaysPerTask); ++ray) {
      const size_t before = samples.size();
      nextStep[ray] = marcher.march(static_cast<uint32_t>(ray), samples);
      firstSample[ray + 1] = static_cast<uint32_t>(samples.size() - before);  // a count, until countsToOffsets
    }
  });
  const uint32_t finished = countsToOffsets(firstSample, rays, a.sampleCapacity);
  if (a.finishedRays) *hostPointer(a.finishedRays) = finished;
  *hostPointer(a.sampleCount) = firstSample[rays];
  if (a.nextStep) std::copy(nextStep.begin(), nextStep.begin() + finished, hostPointer(a.nextStep));
  uint32_t* const rayOfSample = hostPointer(a.rayOfSample);
  uint32_t* const slotOfSample = hostPointer(a.slotOfSample);
  float* const positions = hostPointer(a.positions);
  float* const distances = hostPointer(a.distances);
  float* const steps = hostPointer(a.steps);
  float* const middles = hostPointer(a.middles);
  float* const widths = hostPointer(a.widths);
  context.pool.run(tasks, [&](size_t task, int) {
    size_t i = firstSample[task * kRaysPerTask];
    const size_t end = firstSample[std::min<size_t>(rays, (task + 1) * kRaysPerTask)];
    for (size_t s = 0; i < end; ++i, ++s) {
      const Sample& sample = samplesOfTask[task][s];
      rayOfSample[i] = sample.ray;
      slotOfSample[i] = sample.slot;
      std::memcpy(positions + 3 * i, sample.position, sizeof(sample.position));
      distances[i] = sample.distance;
      steps[i] = sample.step;
      middles[i] = sample.middle;
      widths[i] = sample.width;
    }
  });
}

}  // namespace tessera::cpu

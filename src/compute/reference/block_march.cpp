#include "compute/block_march.h"

#include <algorithm>
#include <cmath>

#include "compute/block_path.h"
#include "compute/reference/convert.h"
#include "compute/reference/functions.h"

namespace tessera::reference {

std::vector<BlockInterval> blockIntervals(const BlockSpace& space, double share, const Point& origin,
                                          const Point& direction, double jitter, double near, double far) {
  std::vector<BlockPiece> pieces;
  blockPath(space, origin, direction, near, pieces);
  std::vector<BlockInterval> intervals;
  double before = 0;  // total length of the pieces in front
  for (const BlockPiece& piece : pieces) {
    const DomainSegment& s = piece.segment;
    const double half = makeBlockDomain(space.placement(piece.block)).half();
    const double step = share * 2 * half;
    for (uint64_t i = 0; i == 0 || (static_cast<double>(i) - 1 + jitter) * step < s.length; ++i) {
      const double from = std::max(0.0, (static_cast<double>(i) - 1 + jitter) * step);
      const double to = std::min(s.length, (static_cast<double>(i) + jitter) * step), middle = 0.5 * (from + to);
      const double begin = s.distanceAt(from);
      if (begin >= far) return intervals;
      BlockInterval interval;
      interval.block = piece.block;
      for (int a = 0; a < 3; ++a) {
        interval.position[a] = std::clamp((s.start[a] + middle * s.direction[a] + half) / (2 * half), 0.0, 1.0);
      }
      interval.distance = s.distanceAt(middle);
      interval.step = std::min({s.distanceBetween(from, to), far - begin, MarchBlocks::kLongestStep});
      interval.middle = before + middle;
      interval.width = to - from;
      intervals.push_back(interval);
    }
    before += s.length;
  }
  return intervals;
}

void run(const MarchBlocks& a) {
  const size_t rays = hostCount(a.rays), cells = a.cells, words = cells * cells * cells / 32;
  const Doubles origins = doubles(a.origins, 3 * rays), directions = doubles(a.directions, 3 * rays);
  const Doubles jitter = doubles(a.jitter, rays), nears = doubles(a.nearOfRay, rays), fars = doubles(a.farOfRay, rays);
  const Doubles opticalDepth = doubles(a.opticalDepth, rays);
  const Indices slots = indices(a.slotOfBlock, a.slotOfBlock.count);
  const Indices occupancy = indices(a.occupancy, a.occupancy.count);
  uint32_t* const nextStep = hostPointer(a.nextStep);
  Doubles positions, distances, steps, middles, widths;
  uint32_t sampleCount = 0, finished = 0;
  bool full = false;
  hostPointer(a.firstSample)[0] = 0;
  for (size_t r = 0; r < rays; ++r) {
    const bool opaque = !opticalDepth.empty() && opticalDepth[r] > a.maxOpticalDepth;
    const uint32_t first = nextStep ? nextStep[r] : 0;
    uint32_t next = opaque || a.maximum == 0 ? first : MarchBlocks::kThrough;
    std::vector<std::pair<uint32_t, BlockInterval>> samples;  // with their slots
    if (!opaque && a.maximum > 0 && first != MarchBlocks::kThrough) {
      const std::vector<BlockInterval> intervals = blockIntervals(
          a.space, a.step, {origins[3 * r], origins[3 * r + 1], origins[3 * r + 2]},
          {directions[3 * r], directions[3 * r + 1], directions[3 * r + 2]}, jitter.empty() ? 1 : jitter[r],
          nears.empty() ? 0 : nears[r], fars.empty() ? std::numeric_limits<double>::infinity() : fars[r]);
      for (uint32_t i = first; i < intervals.size() && next == MarchBlocks::kThrough; ++i) {
        const uint32_t slot = slots.empty() ? intervals[i].block : slots[intervals[i].block];
        if (slot == kNoSlot) continue;
        size_t cell = 0;
        for (int axis = 2; axis >= 0; --axis) {
          const double place = intervals[i].position[axis] * static_cast<double>(cells);
          cell = cell * cells + std::min(static_cast<size_t>(place), cells - 1);
        }
        if ((occupancy[slot * words + cell / 32] >> cell % 32 & 1) == 0) continue;
        samples.emplace_back(slot, intervals[i]);
        if (samples.size() == a.maximum) next = i + 1;
      }
    }
    full = full || sampleCount + samples.size() > a.sampleCapacity;
    if (!full) {
      ++finished;
      if (nextStep) nextStep[r] = next;
      for (const auto& [slot, sample] : samples) {
        hostPointer(a.rayOfSample)[sampleCount] = static_cast<uint32_t>(r);
        hostPointer(a.slotOfSample)[sampleCount] = slot;
        ++sampleCount;
        positions.insert(positions.end(), sample.position.begin(), sample.position.end());
        distances.push_back(sample.distance);
        steps.push_back(sample.step);
        middles.push_back(sample.middle);
        widths.push_back(sample.width);
      }
    }
    hostPointer(a.firstSample)[r + 1] = sampleCount;
  }
  hostPointer(a.sampleCount)[0] = sampleCount;
  if (a.finishedRays) hostPointer(a.finishedRays)[0] = finished;
  store(a.positions, positions);
  store(a.distances, distances);
  store(a.steps, steps);
  store(a.middles, middles);
  store(a.widths, widths);
}

}  // namespace tessera::reference

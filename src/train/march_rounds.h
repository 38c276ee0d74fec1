// Finds the samples of rays that can be seen: those in front of the point where transmittance has fallen below a bound.
// Marches in rounds from the front and looks densities up in between, so that what lies behind surfaces costs little.
// Rays whose samples do not fit are not finished, nor are those after them.
//
//   rounds.begin(rays, capacity, minTransmittance, counters);
//   for (uint32_t round = 0; round < rounds.count(); ++round) {
//     rounds.prepare(march, round);  // ... and what else a march makes, in rounds.part(array, columns, round)
//     device.run(march);
//     ... log densities of rounds.made(round) samples, into rounds.logDensities(round)
//     rounds.lookedUp(round);
//   }
//   rounds.keepSeen(firstSample, rayOfSample);
//   rounds.gather(array, kept, columns);
#pragma once

#include <algorithm>
#include <numeric>
#include <span>
#include <vector>

#include "compute/device.h"

namespace tessera {

class MarchRounds {
 public:
  // What counters hold: samples kept, rays finished, and from kMarched on the samples made in each round.
  static constexpr uint32_t kKept = 0, kFinished = 1, kMarched = 2;

  // `most`: samples of a ray that a round makes. Few at first, for most rays end early.
  MarchRounds(Device& device, std::vector<uint32_t> most) : device_(device), most_(std::move(most)) {}

  uint32_t count() const { return static_cast<uint32_t>(most_.size()); }

  // Room for so many rays, and for so many samples a round, and as many that are kept.
  void reserve(uint32_t rays, uint32_t samples);
  uint32_t sampleCapacity() const { return static_cast<uint32_t>(source_.size()); }

  // `counters`: [kMarched + count()].
  void begin(uint32_t rays, uint32_t capacity, float minTransmittance, Slice<uint32_t> counters);

  // A MarchRays or MarchBlocks for this round.
  template <class March>
  void prepare(March& march, uint32_t round) {
    march.rays = {rays_};
    march.sampleCapacity = samples_;
    march.most = most_[round];
    march.mostOpticalDepth = mostOpticalDepth_;
    march.opticalDepth = opticalDepth_;
    march.nextStep = nextStep_;
    march.firstSample = firstOf(round);
    march.sampleCount = counters_.part(kMarched + round, 1);
    march.steps = part(steps_, 1, round);
  }

  Count made(uint32_t round) const { return {samples_, counters_.part(kMarched + round, 1)}; }
  Matrix<float> logDensities(uint32_t round) { return {part(logDensities_, 1, round), 1}; }
  void lookedUp(uint32_t round);  // takes the densities into account

  // [count()][samples of a round][columns], of this round.
  template <class Element>
  Slice<Element> part(Array<Element>& array, uint32_t columns, uint32_t round) const {
    return array.part(size_t{round} * samples_ * columns, size_t{samples_} * columns);
  }

  // Which samples are seen: of each ray the first, [rays + 1], and of each sample the ray.
  void keepSeen(Slice<uint32_t> firstSample, Slice<uint32_t> rayOfSample);
  // What marches made for those, from [count()][samples of a round][columns] to [samples][columns].
  void gather(Slice<const float> made, Slice<float> kept, uint32_t columns);
  void gatherSteps(Slice<float> kept) { gather(steps_, kept, 1); }

 private:
  Slice<uint32_t> firstOf(uint32_t round) { return roundFirst_.part(round * (rays_ + size_t{1}), rays_ + size_t{1}); }

  Device& device_;
  std::vector<uint32_t> most_;

  // Of the rays that are being marched.
  uint32_t rays_ = 0, samples_ = 0;
  float mostOpticalDepth_ = 0;
  Slice<uint32_t> counters_;

  Array<uint32_t> nextStep_, source_;
  Array<uint32_t> roundFirst_;  // [count()][rays + 1]
  Array<float> opticalDepth_, steps_, logDensities_;
};

// What counters of so many rounds say, once they are read.
struct RoundCounts {
  uint32_t kept, finished;
  uint32_t marched;  // samples made in all rounds
  uint32_t fullest;  // samples of whichever had most, a round or what is kept: each has the same room

  RoundCounts(std::span<const uint32_t> counters, uint32_t rounds)
      : kept(counters[MarchRounds::kKept]), finished(counters[MarchRounds::kFinished]) {
    const std::span<const uint32_t> made = counters.subspan(MarchRounds::kMarched, rounds);
    marched = std::accumulate(made.begin(), made.end(), 0u);
    fullest = std::max(kept, *std::max_element(made.begin(), made.end()));
  }
};

}  // namespace tessera

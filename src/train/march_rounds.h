// Finds the visible samples of rays: those in front of the point where transmittance falls below a bound. Marches in
// rounds from the front and evaluates densities in between, so that what lies behind surfaces costs little. Rays whose
// samples exceed the capacity are not finished, nor are the rays after them.
//
//   rounds.begin(rays, capacity, minTransmittance, counters);
//   for (uint32_t round = 0; round < rounds.count(); ++round) {
//     rounds.prepare(march, round);  // ... and further outputs of the march, in rounds.part(array, columns, round)
//     device.run(march);
//     ... evaluate the log densities of rounds.marched(round) samples into rounds.logDensities(round), or all that is
//     stored of a sample into rounds.features(round)
//     rounds.addOpticalDepths(round);
//   }
//   rounds.compactVisible(firstSample, rayOfSample);
//   rounds.gather(array, visible, columns);
#pragma once

#include <algorithm>
#include <numeric>
#include <span>
#include <vector>

#include "compute/device.h"

namespace tessera {

class MarchRounds {
 public:
  // Indices into the counters: visible samples, finished rays, and from kMarched on the samples marched in each round.
  static constexpr uint32_t kVisible = 0, kFinished = 1, kMarched = 2;

  // `maximum`: [rounds], the most samples of a ray that each round marches; few at first, because most rays end early.
  // Keeps a reference to `device`.
  MarchRounds(Device& device, std::vector<uint32_t> maximum) : device_(device), max_(std::move(maximum)) {}

  uint32_t count() const { return static_cast<uint32_t>(max_.size()); }

  // Allocates memory for `rays` rays, `samples` samples per round, and `samples` visible samples. `features`: the
  // number of values stored for each marched sample, of which the first is its log density.
  void reserve(uint32_t rays, uint32_t samples, uint32_t features = 1);
  uint32_t sampleCapacity() const { return static_cast<uint32_t>(source_.size()); }

  // Starts new rays. `counters`: [kMarched + count()].
  void begin(uint32_t rays, uint32_t capacity, float minTransmittance, Slice<uint32_t> counters);

  // Fills in the fields of a MarchRays or MarchBlocks for this round.
  template <class March>
  void prepare(March& march, uint32_t round) {
    march.rays = {rays_};
    march.sampleCapacity = samples_;
    march.maximum = max_[round];
    march.maxOpticalDepth = maxOpticalDepth_;
    march.opticalDepth = opticalDepth_;
    march.nextStep = nextStep_;
    march.firstSample = roundFirstSamples(round);
    march.sampleCount = counters_.part(kMarched + round, 1);
    march.steps = part(steps_, 1, round);
  }

  Count marched(uint32_t round) const { return {samples_, counters_.part(kMarched + round, 1)}; }
  Matrix<float> features(uint32_t round) { return {part(features_, featureCount_, round), featureCount_}; }
  Matrix<float> logDensities(uint32_t round) { return features(round).columnRange(0, 1); }
  void addOpticalDepths(uint32_t round);  // adds the densities of this round to the rays' optical depths

  // Returns the part of this round of an array [count()][samples of a round][columns].
  template <class Element>
  Slice<Element> part(Array<Element>& array, uint32_t columns, uint32_t round) const {
    return array.part(size_t{round} * samples_ * columns, size_t{samples_} * columns);
  }

  // Finds the visible samples. Writes the first one of each ray, [rays + 1], and the ray of each one, [samples].
  void compactVisible(Slice<uint32_t> firstSample, Slice<uint32_t> rayOfSample);
  // Copies what the marches wrote for the visible samples, from [count()][samples of a round][columns] to
  // [samples][columns].
  void gather(Slice<const float> from, Slice<float> to, uint32_t columns);
  void gatherSteps(Slice<float> to) { gather(steps_, to, 1); }
  void gatherFeatures(Matrix<float> to);  // `to`: as many columns as features were reserved

 private:
  Slice<uint32_t> roundFirstSamples(uint32_t round) {
    return roundFirst_.part(round * (rays_ + size_t{1}), rays_ + size_t{1});
  }

  Device& device_;
  std::vector<uint32_t> max_;

  // These describe the rays that are being marched.
  uint32_t rays_ = 0, samples_ = 0;
  float maxOpticalDepth_ = 0;
  Slice<uint32_t> counters_;

  Array<uint32_t> nextStep_, source_;
  Array<uint32_t> roundFirst_;  // [count()][rays + 1]
  uint32_t featureCount_ = 1;
  Array<float> opticalDepth_, steps_;
  Array<float> features_;  // [count()][samples][featureCount_]
};

// The counters of MarchRounds, read back from the device.
struct RoundCounts {
  uint32_t visibleSamples, finished;
  uint32_t marched;  // samples of all rounds
  uint32_t fullest;  // the largest number of samples in any round or of visible ones: all have the same capacity

  RoundCounts(std::span<const uint32_t> counters, uint32_t rounds)
      : visibleSamples(counters[MarchRounds::kVisible]), finished(counters[MarchRounds::kFinished]) {
    const std::span<const uint32_t> perRound = counters.subspan(MarchRounds::kMarched, rounds);
    marched = std::accumulate(perRound.begin(), perRound.end(), 0u);
    fullest = std::max(visibleSamples, *std::max_element(perRound.begin(), perRound.end()));
  }
};

}  // namespace tessera

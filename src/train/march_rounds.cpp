#include "train/march_rounds.h"

#include <cmath>

#include "base/check.h"
#include "compute/rays.h"
#include "compute/rows.h"

namespace tessera {

void MarchRounds::reserve(uint32_t rays, uint32_t samples) {
  if (nextStep_.size() < rays || !roundFirst_.size()) {
    nextStep_ = device_.array<uint32_t>(rays);
    opticalDepth_ = device_.array<float>(rays);
    roundFirst_ = device_.array<uint32_t>(count() * (rays + size_t{1}));
  }
  if (source_.size() < samples) {
    source_ = device_.array<uint32_t>(samples);
    for (Array<float>* each : {&steps_, &logDensities_}) *each = device_.array<float>(size_t{count()} * samples);
  }
}

void MarchRounds::begin(uint32_t rays, uint32_t capacity, float minTransmittance, Slice<uint32_t> counters) {
  CHECK(nextStep_.size() >= rays);
  CHECK(source_.size() >= capacity);
  rays_ = rays;
  samples_ = capacity;
  maxOpticalDepth_ = -std::log(minTransmittance);
  counters_ = counters;
  device_.fillZero(nextStep_.part(0, rays));
  device_.fillZero(opticalDepth_.part(0, rays));
}

void MarchRounds::lookedUp(uint32_t round) {
  device_.run(
      OpticalDepth{{rays_}, roundFirstSamples(round), logDensities(round), part(steps_, 1, round), opticalDepth_});
}

void MarchRounds::keepSeen(Slice<uint32_t> firstSample, Slice<uint32_t> rayOfSample) {
  CompactSamples compact;
  compact.rays = {rays_};
  compact.rounds = count();
  compact.sampleCapacity = compact.keptCapacity = samples_;
  compact.maxOpticalDepth = maxOpticalDepth_;
  compact.firstSample = roundFirst_;
  compact.nextStep = nextStep_;
  compact.logDensity = Matrix<float>(logDensities_, 1);
  compact.steps = steps_;
  compact.keptFirstSample = firstSample;
  compact.keptCount = counters_.part(kKept, 1);
  compact.finishedRays = counters_.part(kFinished, 1);
  compact.source = source_;
  compact.rayOfSample = rayOfSample;
  device_.run(compact);
}

void MarchRounds::gather(Slice<const float> from, Slice<float> to, uint32_t columns) {
  device_.run(GatherRows{
      {samples_, counters_.part(kKept, 1)}, source_, Matrix<const float>(from, columns), Matrix<float>(to, columns)});
}

}  // namespace tessera

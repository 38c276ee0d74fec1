#include "train/march_rounds.h"

#include <cmath>

#include "base/check.h"
#include "compute/rays.h"
#include "compute/rows.h"

namespace tessera {

void MarchRounds::reserve(uint32_t rays, uint32_t samples, uint32_t features) {
  if (nextStep_.size() < rays || !roundFirst_.size()) {
    nextStep_ = device_.array<uint32_t>(rays);
    opticalDepth_ = device_.array<float>(rays);
    roundFirst_ = device_.array<uint32_t>(count() * (rays + size_t{1}));
  }
  if (source_.size() < samples) {
    source_ = device_.array<uint32_t>(samples);
    steps_ = device_.array<float>(size_t{count()} * samples);
  }
  featureCount_ = features;
  const size_t values = size_t{count()} * samples * features;
  if (features_.size() < values) features_ = device_.array<float>(values);
}

void MarchRounds::begin(uint32_t rays, uint32_t capacity, float minTransmittance, Slice<uint32_t> counters) {
  CHECK(nextStep_.size() >= rays);
  CHECK(source_.size() >= capacity);
  CHECK(features_.size() >= size_t{count()} * capacity * featureCount_);
  rays_ = rays;
  samples_ = capacity;
  maxOpticalDepth_ = -std::log(minTransmittance);
  counters_ = counters;
  device_.fillZero(nextStep_.part(0, rays));
  device_.fillZero(opticalDepth_.part(0, rays));
}

void MarchRounds::addOpticalDepths(uint32_t round) {
  device_.run(
      OpticalDepth{{rays_}, roundFirstSamples(round), logDensities(round), part(steps_, 1, round), opticalDepth_});
}

void MarchRounds::compactVisible(Slice<uint32_t> firstSample, Slice<uint32_t> rayOfSample) {
  CompactSamples compact;
  compact.rays = {rays_};
  compact.rounds = count();
  compact.sampleCapacity = compact.keptCapacity = samples_;
  compact.maxOpticalDepth = maxOpticalDepth_;
  compact.firstSample = roundFirst_;
  compact.nextStep = nextStep_;
  compact.logDensity = Matrix<float>(features_.all(), featureCount_).columnRange(0, 1);
  compact.steps = steps_;
  compact.keptFirstSample = firstSample;
  compact.keptCount = counters_.part(kVisible, 1);
  compact.finishedRays = counters_.part(kFinished, 1);
  compact.source = source_;
  compact.rayOfSample = rayOfSample;
  device_.run(compact);
}

void MarchRounds::gather(Slice<const float> from, Slice<float> to, uint32_t columns) {
  device_.run(GatherRows{{samples_, counters_.part(kVisible, 1)},
                         source_,
                         Matrix<const float>(from, columns),
                         Matrix<float>(to, columns)});
}

void MarchRounds::gatherFeatures(Matrix<float> to) {
  device_.run(
      GatherRows{{samples_, counters_.part(kVisible, 1)}, source_, Matrix<float>(features_.all(), featureCount_), to});
}

}  // namespace tessera

// What the stages of a run from photos will take, by what is known at the time: before any has run, by the rates of a
// few photos, and later by the features and matches that there are.
#pragma once

#include <optional>
#include <string>

#include "photogrammetry/photo_matches.h"
#include "pipeline/photo_run.h"
#include "pipeline/run_plan.h"

namespace tessera {

class RunEstimator {
 public:
  // The first three must outlive this object. `photosDigest` tells whether rates that OUT/probe.json has are those of
  // the same photos.
  RunEstimator(const PhotoRunOptions& options, const PhotoList& list, const PhotoMatches& matches,
               std::string photosDigest, int downscale);

  // Measure rates when they are first called. Throw RunInterrupted, and Error as measureMatchingRates and holdOut do.
  MatchingNeeds matchingNeeds();
  StageNeeds featureNeeds(bool resumes);
  StageNeeds matchNeeds(bool resumes);
  TrainingNeeds trainingNeeds();

 private:
  const MatchingRates& rates();
  int64_t expectedPairs();
  int threads() const;

  const PhotoRunOptions& options_;
  const PhotoList& list_;
  const PhotoMatches& matches_;
  std::string photosDigest_;
  int downscale_;
  std::optional<MatchingRates> rates_;
  int64_t expectedPairs_ = 0;  // 0: not known yet
};

}  // namespace tessera

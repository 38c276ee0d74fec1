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
               std::string photosDigest);

  // Measure rates when they are first called. Throw RunInterrupted, and Error as measureMatchingRates and holdOut do.
  MatchingNeeds matchingNeeds();
  StageNeeds featureNeeds(bool resumes);
  StageNeeds matchNeeds(bool resumes);
  StageNeeds lookAlikeNeeds();
  // Those of comparing so many more pairs, and of placing the photos that are missing in the model.
  StageNeeds remappingNeeds(size_t missing, size_t pairs);

  // From now on, the number of pairs is known.
  void setPairs(size_t pairs) { expectedPairs_ = static_cast<int64_t>(pairs); }

  // How large the capture is if its photos keep their size. Throws Error as holdOut does.
  const TrainingSize& trainingSize();
  // How large it is in the folder of the run, on this machine, whose rates are measured when this is first called.
  TrainingSize trainingSize(int downscale);

 private:
  const MatchingRates& rates();
  std::optional<MatchingRates> readRates(const std::string& key) const;
  MatchingRates anyRates();
  int64_t expectedPairs();
  int64_t countForLookAlikes();
  int threads() const;

  const PhotoRunOptions& options_;
  const PhotoList& list_;
  const PhotoMatches& matches_;
  std::string photosDigest_;
  std::optional<MatchingRates> rates_;
  std::optional<TrainingSize> trainingSize_;
  int64_t expectedPairs_ = 0;             // 0: not known yet
  std::optional<int64_t> forLookAlikes_;  // once it is counted
};

}  // namespace tessera

// What the stages from the capture to the evaluation will take, by what is known when it is asked for: the capture and
// the model, if they will be kept, else what the photos tell of them.
#pragma once

#include <functional>
#include <optional>

#include "pipeline/photo_run.h"

namespace tessera {

class TrainingPlanner {
 public:
  // What is known before there is a capture.
  struct Source {
    std::function<TrainingSize()> size;
    std::function<std::optional<Capture>()> capture;  // with photos as large as they are; nothing: not known
    std::function<int()> downscale;                   // by which the photos are divided
    bool isGuess = false;                             // whether that capture is
  };

  // `options` must outlive this object.
  TrainingPlanner(const PhotoRunOptions& options, Source source);

  TrainingNeeds needs();
  // `resumes`: without the disk that the files of an interrupted capture take already.
  StageNeeds captureNeeds(bool resumes);
  // `resumes`: what is left of the training of the model that is there.
  StageNeeds trainNeeds(bool resumes);

  // The plan asks for the stages that are not finished in their order: so it tells which results will be replaced, as
  // captureNeeds() does.
  void expectNewModel() { isModelKept_ = false; }
  void captureIsWritten();
  void modelIsTrained() { isModelKept_ = true; }
  void photosAreListed() { costs_.reset(); }

 private:
  std::optional<Capture> keptCapture() const;
  std::optional<Capture> expectedCapture() const;  // before there is one
  const TrainingCosts& costs();
  double shareTrained() const;  // of the finest level

  const PhotoRunOptions& options_;
  Source source_;
  bool isCaptureKept_ = true, isModelKept_ = true;
  std::optional<TrainingCosts> costs_;
  int64_t capturePixels_ = 0;  // of a photo of the capture that is kept; 0: not known
};

}  // namespace tessera

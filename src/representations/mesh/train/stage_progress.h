// The progress of a stage that goes through the photos before a mesh is trained: what moves in them, views between
// them, and the surfaces that they show.
#pragma once

#include <functional>
#include <optional>
#include <string>

#include "base/progress.h"
#include "train/training_loop.h"

namespace tessera {

// Called after each photo. May throw, which ends the stage: it leaves nothing that a later run would take for complete.
using OnPhoto = std::function<void(int64_t done, int64_t all)>;
inline const OnPhoto kNobodyWatches = [](int64_t, int64_t) {};

// Thrown by StageProgress if the training is asked to stop.
struct StageStopped {};

class StageProgress {
 public:
  // `loop` says whether progress is shown, and when to stop. It must outlive this object, which must outlive onPhoto().
  StageProgress(const std::string& title, const TrainingLoopOptions& loop) : loop_(loop) {
    if (loop.progress) progress_.emplace(title, 0, "photos");
  }
  OnPhoto onPhoto() {
    return [this](int64_t done, int64_t all) {
      if (loop_.stopRequested()) throw StageStopped();
      if (!progress_) return;
      progress_->setTotal(all);
      progress_->update(done);
    };
  }
  void finish() {
    if (progress_) progress_->finish();
  }

 private:
  const TrainingLoopOptions& loop_;
  std::optional<Progress> progress_;
};

}  // namespace tessera

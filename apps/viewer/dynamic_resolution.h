// Chooses how many pixels to draw while the camera moves: as many as can be drawn in time. The browser's viewer does
// the same (web/src/app/moving/resolution.ts).
#pragma once

#include <algorithm>
#include <array>
#include <cmath>

namespace tessera {

class DynamicResolution {
 public:
  // `target`: milliseconds that a frame may take. Begins with all pixels, or with the smallest number.
  enum class Begin { all, few };
  explicit DynamicResolution(double target, Begin begin = Begin::all)
      : target_(target), step_(begin == Begin::all ? kShares.size() - 1 : 0) {}

  double share() const { return kShares[step_]; }  // fraction of the pixels along an edge

  // Reports how long the last frame took, at the current share.
  void took(double milliseconds) {
    if (unmeasured_ > 0) {
      --unmeasured_;
      return;
    }
    measured_ = measured_ == 0 ? milliseconds : 0.6 * measured_ + 0.4 * milliseconds;
    if (measured_ > target_) {
      inTime_ = 0;
      if (step_ == 0) return;
      change(step_ - 1);
      if (tried_) wait_ = std::min(2 * wait_, kLongestWait * kPatience);
      tried_ = false;
      return;
    }
    if (++inTime_ > wait_ && tried_) {  // the trial with more pixels has succeeded
      tried_ = false;
      wait_ = kPatience;
    }
    if (step_ + 1 == kShares.size()) return;
    const double more = kShares[step_ + 1] / kShares[step_];
    if (measured_ * more * more < 0.7 * target_) {
      change(step_ + 1);
    } else if (inTime_ > wait_) {
      // Where frames never arrive faster than the screen refreshes, the cost of more pixels cannot be extrapolated, so
      // more are tried.
      change(step_ + 1);
      tried_ = true;
      measured_ = 0;
      unmeasured_ = kUnmeasured;
    }
  }

 private:
  static constexpr std::array<double, 6> kShares = {0.125, 0.25, 0.375, 0.5, 0.75, 1};
  static constexpr int kPatience = 120;  // frames in time after which more pixels are tried
  static constexpr int kLongestWait =
      16;  // upper limit of that wait, as a multiple; it doubles whenever a trial was too slow
  static constexpr int kUnmeasured = 3;  // frames that are not measured after more pixels are tried

  void change(size_t step) {
    const double ratio = kShares[step] / kShares[step_];
    measured_ *= ratio * ratio;
    step_ = step;
    inTime_ = 0;
  }

  double target_;
  size_t step_;
  double measured_ = 0;  // milliseconds per frame at this step
  int inTime_ = 0;       // number of frames in time since the last step
  int wait_ = kPatience;
  int unmeasured_ = 0;
  bool tried_ = false;  // whether this step is a trial
};

}  // namespace tessera

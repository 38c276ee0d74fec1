// The number of rays of the next training step: as many as a method aims for, fewer if a step exceeds its capacity.
#pragma once

#include <algorithm>

#include "base/safetensors.h"
#include "field/parameters.h"
#include "train/settings/rays.h"

namespace tessera {

class RayBudget {
 public:
  // The number of rays is always a multiple of `group`.
  explicit RayBudget(const RaySettings& settings, uint32_t group = 1)
      : group_(group),
        max_(wholeGroups(static_cast<uint32_t>(settings.maxRays))),
        rays_(wholeGroups(static_cast<uint32_t>(settings.firstRays))) {}

  uint32_t rays() const { return rays_; }
  bool canShrink() const { return rays_ > group_; }

  // Called after a step with the number of rays that the method estimates for the next one.
  void aimFor(double rays) {
    const uint32_t minimum = std::max(kMin, group_);
    rays_ = static_cast<uint32_t>(std::clamp<double>(rays, minimum, max_));
  }
  // Called after an attempt at a step that required `required` of a resource of which `capacity` is available. Returns
  // true, having reduced the number of rays, if the step is to be repeated. The requirement grows more slowly than
  // the number of rays.
  bool drawsFewer(double required, double capacity) {
    constexpr double kFewer = 0.9;
    if (required <= capacity || !canShrink()) return false;
    rays_ = std::max(1u, static_cast<uint32_t>(kFewer * capacity / required * rays_ / group_)) * group_;
    return true;
  }

  // Adds the tensor `rays` of a checkpoint.
  void save(TensorSet& tensors) const { tensors.add("rays", std::vector<uint32_t>{rays_}); }
  // Reads that tensor. Throws Error if it is missing or malformed.
  void restore(const fs::path& path, const Safetensors& state);

 private:
  static constexpr uint32_t kMin = 8;
  uint32_t wholeGroups(uint32_t rays) const { return rays / group_ * group_; }

  uint32_t group_, max_, rays_;
};

}  // namespace tessera

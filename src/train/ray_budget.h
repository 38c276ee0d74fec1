// How many rays the next training step draws: as many as a method aims for, fewer at once where a step has no room.
#pragma once

#include <algorithm>

#include "base/safetensors.h"
#include "field/parameters.h"
#include "train/settings/rays.h"

namespace tessera {

class RayBudget {
 public:
  // Rays come in whole groups.
  explicit RayBudget(const RaySettings& settings, uint32_t group = 1)
      : group_(group),
        most_(wholeGroups(static_cast<uint32_t>(settings.mostRays))),
        rays_(wholeGroups(static_cast<uint32_t>(settings.firstRays))) {}

  uint32_t rays() const { return rays_; }
  bool canShrink() const { return rays_ > group_; }

  // After a step: as many as its method has worked out that the next one should have, in whole groups.
  void aimFor(double rays) {
    const uint32_t least = std::max(kLeast, group_);
    rays_ = static_cast<uint32_t>(std::clamp<double>(rays, least, most_));
  }
  // After a try of a step that wanted so much where there is room for so much: true where it is to be tried again with
  // fewer rays. What is wanted grows more slowly than rays.
  bool drawsFewer(double wanted, double room) {
    constexpr double kFewer = 0.9;
    if (wanted <= room || !canShrink()) return false;
    rays_ = std::max(1u, static_cast<uint32_t>(kFewer * room / wanted * rays_ / group_)) * group_;
    return true;
  }

  // The tensor `rays` of a checkpoint.
  void save(TensorSet& tensors) const { tensors.add("rays", std::vector<uint32_t>{rays_}); }
  // Throws Error where there is none.
  void restore(const fs::path& path, const Safetensors& state);

 private:
  static constexpr uint32_t kLeast = 8;
  uint32_t wholeGroups(uint32_t rays) const { return rays / group_ * group_; }

  uint32_t group_, most_, rays_;
};

}  // namespace tessera

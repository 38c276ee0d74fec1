// Settings of the rays of a training step: the photos that they are drawn from, their number, and where they start.
#pragma once

#include "base/setting.h"
#include "train/photo_rays.h"

namespace tessera {

struct RaySettings {
  SETTING(int64_t, seed, 0, "seed", "seed of all random numbers", anything());
  SETTING(int, firstRays, 512, "first_rays", "rays of the first step", within(1, maxRays).dependent());
  SETTING(int, maxRays, 1 << 14, "max_rays", "rays that a step never exceeds", within(64, 1 << 24));
  SETTING(double, near, 0.05, "near",
          "minimum distance of samples from a camera, in half block edges (without blocks: half edges of the region of "
          "interest)",
          share());
  SETTING(
      double, photoBudgetMiB, 0, "photo_budget_mib",
      "memory for decoded photos in MiB; 0: as much as they need, but at most two fifths of the memory that is planned "
      "for (without blocks: half of the machine's memory)",
      atLeast(0));
  SETTING(int, stepsPerPhoto, 2, "steps_per_photo", "with a photo budget: steps after which one photo is exchanged",
          within(1, 1 << 30));
  SETTING(double, sparseDepthRayFraction, 0.125, "sparse_depth_ray_fraction",
          "share of the rays through sparse points, in captures that have some", share());

  // Returns the settings of PhotoRays that all methods share; a method adds its own.
  PhotoRays::Settings photoRaySettings() const {
    PhotoRays::Settings settings;
    settings.seed = static_cast<uint64_t>(seed);
    settings.maxRays = static_cast<uint32_t>(maxRays);
    settings.photoBudgetMiB = photoBudgetMiB;
    settings.stepsPerPhoto = stepsPerPhoto;
    settings.sparseDepthRayFraction = sparseDepthRayFraction;
    return settings;
  }
};

struct RandomBackgroundSettings {
  SETTING(bool, randomBackground, true, "random_background", "train against random colours behind the scene",
          anything());
};

// For methods whose steps aim for a number of samples.
struct SampleBudgetSettings {
  SETTING(int, samplesPerStep, 1 << 16, "samples_per_step",
          "target number of samples per step; the number of rays adapts", within(64, 1 << 24));
};

// For methods whose steps evaluate each texel once for all samples.
struct TexelBudgetSettings {
  SETTING(int, texelsPerStep, 1 << 19, "texels_per_step",
          "target number of texels, or of lattice corners, per step; the number of rays adapts", within(64, 1 << 26));
};

}  // namespace tessera

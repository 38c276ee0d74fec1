// Settings of the rays of a training step: which photos they are of, how many there are, and where they begin.
#pragma once

#include "base/setting.h"
#include "train/photo_rays.h"

namespace tessera {

struct RaySettings {
  SETTING(int64_t, seed, 0, "seed", "of everything random", anything());
  SETTING(int, firstRays, 512, "first_rays", "rays of the first step", within(1, mostRays).dependent());
  SETTING(int, mostRays, 1 << 14, "most_rays", "rays that a step never exceeds", within(64, 1 << 24));
  SETTING(double, near, 0.05, "near",
          "no sample nearer to a camera, in halves of a block (without blocks: of the region of interest)", share());
  SETTING(double, photoBudgetMiB, 0, "photo_budget_mib",
          "memory for decoded photos in MiB; 0: as they need, but at most two fifths of what is planned for (without "
          "blocks: half of the machine's)",
          atLeast(0));
  SETTING(int, stepsPerPhoto, 2, "steps_per_photo", "with a photo budget: steps after which one photo is exchanged",
          within(1, 1 << 30));
  SETTING(double, knownShare, 0.125, "known_share",
          "share of the rays through sparse points, in captures that have some", share());

  // With rays through sparse points, and colours behind transparent photos; a method adds what only it asks for.
  PhotoRays::Settings photoRaySettings() const {
    PhotoRays::Settings settings;
    settings.seed = static_cast<uint64_t>(seed);
    settings.mostRays = static_cast<uint32_t>(mostRays);
    settings.photoBudgetMiB = photoBudgetMiB;
    settings.stepsPerPhoto = stepsPerPhoto;
    settings.knownShare = knownShare;
    return settings;
  }
};

struct RandomBackgroundSettings {
  SETTING(bool, randomBackground, true, "random_background", "train against random colours behind the scene",
          anything());
};

// Of methods whose steps aim for a number of samples.
struct SampleBudgetSettings {
  SETTING(int, samplesPerStep, 1 << 16, "samples_per_step", "samples that a step aims for; rays adapt",
          within(64, 1 << 24));
};

// Of methods whose steps evaluate texels once for all samples.
struct TexelBudgetSettings {
  SETTING(int, texelsPerStep, 1 << 19, "texels_per_step",
          "texels, or corners of the lattice, that a step aims for; rays adapt", within(64, 1 << 26));
};

}  // namespace tessera

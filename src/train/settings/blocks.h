// Settings of methods that train in blocks, and of the coarser levels of detail.
#pragma once

#include "base/error.h"
#include "base/setting.h"

namespace tessera {

struct BackgroundBlockSettings {
  SETTING(std::string, backgroundBlock, "own", "background_block",
          "what represents the space outside the region: own (a separate background block), border (the blocks at "
          "the border, as in the papers; only if all blocks are trained together, which mesh does not) or none",
          anything());  // see parseBackgroundBlockMode
};

struct PresetSettings {
  // `cpu` selects the defaults, `paper` the values of the method's paper, for large GPUs.
  SETTING(std::string, preset, "cpu", "preset", "preset of all other defaults: cpu, or paper (for large GPUs)",
          anything());
};

// Returns whether the preset is `paper`; else it is `cpu`. Throws Error if there is no preset of that name.
inline bool isPaperPreset(const std::string& name) {
  if (name != "cpu" && name != "paper")
    throw Error("--set preset=" + name, "", "there is no such preset", "use cpu or paper");
  return name == "paper";
}

struct BlockSettings : BackgroundBlockSettings, PresetSettings {
  SETTING(int, lod, 0, "lod", "level of detail: 0 is the finest; set by training for coarser levels", within(0, 16));
  SETTING(int64_t, finestStep, 0, "finest_step",
          "of a coarser level: steps of the finest one when it was created; set by training", anything());
  SETTING(double, lodStepFraction, 0.2, "lod_step_fraction",
          "steps of the first coarser level of detail, as a share of the finest's, each next one taking twice as many, "
          "up to the finest's; 0: no coarser levels",
          within(0, 10));
};

}  // namespace tessera

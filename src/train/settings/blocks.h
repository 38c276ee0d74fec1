// Settings of what is trained in blocks, and of its coarser levels of detail.
#pragma once

#include "base/setting.h"

namespace tessera {

struct BlockSettings {
  // `cpu`, the defaults; `paper`, what the method's paper uses on large graphics cards.
  SETTING(std::string, preset, "cpu", "preset", "the defaults of all others: cpu, or paper (large graphics cards)",
          anything());
  SETTING(std::string, surround, "own", "surround",
          "what lies outside the region: own (a block of its own), border (the border blocks', as in the papers), none",
          anything());  // see surroundNamed
  SETTING(int, level, 0, "level", "of detail: 0 is the finest; set by training for those above", within(0, 16));
  SETTING(int64_t, finestStep, 0, "finest_step",
          "of a coarser level: steps of the finest one when it was made; set by training", anything());
  SETTING(double, levelShare, 0.2, "level_share",
          "steps of the first coarser level of detail, as a share of the finest's, each next one taking twice as many, "
          "up to the finest's; 0: no coarser levels",
          within(0, 10));
};

}  // namespace tessera

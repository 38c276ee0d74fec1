// Settings of occupancy grids (occupancy_grid.h), with which rays skip empty space.
#pragma once

#include "base/setting.h"

namespace tessera {

struct OccupancySettings {
  SETTING(int, occupancyResolution, 128, "occupancy_resolution", "cells along an edge of an occupancy grid",
          within(4, 512).withDivisor(4, 0));
  SETTING(int, occupancyEvery, 16, "occupancy_every", "steps between updates of the occupancy", within(1, 1 << 30));
  SETTING(int, occupancyWarmupSteps, 256, "occupancy_warmup_steps", "steps during which updates look at every cell",
          within(0, 1 << 30));
  SETTING(double, occupancyUpdateFraction, 0.0625, "occupancy_update_fraction",
          "share of the cells that an update evaluates at random, and the same number again among the occupied cells",
          share());
};

}  // namespace tessera

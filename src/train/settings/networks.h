// Settings of hash grids and networks, for methods that have one of each, or one main one.
#pragma once

#include "base/setting.h"

namespace tessera {

struct NetworkSettings {
  SETTING(int, width, 64, "width", "hidden width of the fields' networks: 16, 32, 64 or 128",
          allowedValues({16, 32, 64, 128}));
};

struct HiddenLayerSettings {
  SETTING(int, hidden, 1, "hidden", "hidden layers of the fields' networks", within(1, 16));
};

struct HashGridSettings {
  SETTING(int, gridLevels, 8, "grid_levels", "hash grid levels", within(1, 64).dependent());  // on features per level
  SETTING(int, gridLog2Size, 17, "grid_log2_size", "log2 of the entries of a level", within(3, 28));
  SETTING(int, gridBase, 16, "grid_base", "coarsest resolution", within(2, 1 << 20));
  SETTING(int, gridFinest, 512, "grid_finest", "finest resolution", within(gridBase, 1 << 20).dependent());
};

}  // namespace tessera

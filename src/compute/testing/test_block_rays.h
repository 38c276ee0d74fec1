// Grids of blocks, and rays through them, for tests.
#pragma once

#include <string>
#include <vector>

#include "compute/blocks.h"
#include "compute/device_test.h"

namespace tessera::device_test {

struct NamedBlockSpace {
  std::string name;
  BlockSpace space;
};

inline std::vector<NamedBlockSpace> blockSpaces() {
  return {
      {"1 × 1", {.columns = 1, .rows = 1, .near = 0, .backgroundBlock = BackgroundBlockMode::none}},
      {"1 × 1, own background block",
       {.columns = 1, .rows = 1, .bottom = -0.5f, .top = 0.4f, .backgroundBlock = BackgroundBlockMode::own}},
      {"3 × 2", {.columns = 3, .rows = 2, .bottom = -0.7f, .top = 0.9f, .backgroundBlock = BackgroundBlockMode::none}},
      {"4 × 3, contracted border",
       {.columns = 4, .rows = 3, .near = 0.2f, .backgroundBlock = BackgroundBlockMode::border}},
      {"3 × 2, own background block",
       {.columns = 3, .rows = 2, .bottom = -0.3f, .top = 0.8f, .backgroundBlock = BackgroundBlockMode::own}},
  };
}

// Rays with origins inside, above and far beside the box, and with random, axis-parallel and zero directions.
struct BlockRays {
  std::vector<float> origins, directions;

  BlockRays(Random& random, const BlockSpace& space, size_t rays)
      : origins(random.floats(3 * rays, -1, 1)), directions(random.directions(rays)) {
    for (size_t r = 0; r < rays; ++r) {
      float* const o = origins.data() + 3 * r;
      float* const d = directions.data() + 3 * r;
      const float reach = r % 5 == 1 ? 3.0f : 1.0f;
      o[0] *= reach * static_cast<float>(space.columns);
      o[1] *= reach * static_cast<float>(space.rows);
      if (r % 3 == 1) o[2] += 2;
      if (r % 3 == 1 && d[2] > 0) d[2] = -d[2];
      if (r % 7 == 3)
        for (int a = 0; a < 3; ++a) d[a] = a == static_cast<int>(r / 7 % 3) ? (r % 2 ? 1.0f : -1.0f) : 0.0f;
      if (r % 11 == 5) d[0] = d[1] = d[2] = 0;
    }
  }
  reference::Point origin(size_t r) const { return {origins[3 * r], origins[3 * r + 1], origins[3 * r + 2]}; }
  reference::Point direction(size_t r) const {
    return {directions[3 * r], directions[3 * r + 1], directions[3 * r + 2]};
  }
};

}  // namespace tessera::device_test

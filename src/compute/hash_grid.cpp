#include "compute/hash_grid.h"

#include <algorithm>
#include <cmath>

namespace tessera {

HashGrid::HashGrid(const HashGridOptions& options) : features(options.features) {
  CHECK(options.levels >= 1);
  CHECK((options.features == 1 || options.features == 2 || options.features == 4 || options.features == 8));
  CHECK(options.log2TableSize >= 3);
  CHECK(options.log2TableSize <= 28);
  const double ratio = static_cast<double>(options.finestResolution) / options.baseResolution;
  size_t first = 0;
  for (int l = 0; l < options.levels; ++l) {
    const double growth = options.levels == 1 ? 1.0 : std::pow(ratio, static_cast<double>(l) / (options.levels - 1));
    const double scale = options.baseResolution * growth - 1.0;
    HashGridLevel level;
    level.scale = static_cast<float>(scale);
    level.resolution = static_cast<uint32_t>(std::ceil(scale - 1e-6)) + 1;
    const uint64_t dense = static_cast<uint64_t>(level.resolution) * level.resolution * level.resolution;
    const uint64_t largest = uint64_t{1} << options.log2TableSize;
    level.entries = static_cast<uint32_t>(std::min((dense + 7) / 8 * 8, largest));
    level.hashed = dense > level.entries;
    level.firstEntry = first;
    first += level.entries;
    levels.push_back(level);
  }
}

}  // namespace tessera

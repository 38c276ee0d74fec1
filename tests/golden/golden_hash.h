// Generates the scene that is committed in tests/golden/hash. Its blocks differ in how their levels are weighted.
#pragma once

#include <nlohmann/json.hpp>

#include "golden/golden_landscape.h"
#include "representations/hash/content/hash_content.h"

namespace tessera::golden {

Scene<HashContent> makeHashScene();

// The checksums that every reader must compute: docs/tile-format.md, section 12.
struct HashSums {
  uint64_t stored = 0, firstStored = 0, occupied = 0, distances = 0;
  ByteSums corners;
  std::vector<ByteSums> tables;
};
HashSums computeSums(const HashPart& part);
nlohmann::ordered_json toJson(const HashSums& sums);

}  // namespace tessera::golden

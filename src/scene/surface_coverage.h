// How well the surfaces of a part of a model cover what its photos show, as training has checked it.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace tessera {

struct SurfaceCoverage {
  std::string part;     // its name, as "block_0_0"
  uint64_t pixels = 0;  // that were checked: they show a surface of the part
  uint64_t holes = 0;   // of them: the part is less than half opaque there

  bool operator==(const SurfaceCoverage&) const = default;
  double share() const { return pixels > 0 ? static_cast<double>(holes) / static_cast<double>(pixels) : 0; }
};

// Returns the sum of all parts, without a name.
inline SurfaceCoverage sumCoverage(const std::vector<SurfaceCoverage>& parts) {
  SurfaceCoverage sum;
  for (const SurfaceCoverage& part : parts) {
    sum.pixels += part.pixels;
    sum.holes += part.holes;
  }
  return sum;
}

}  // namespace tessera

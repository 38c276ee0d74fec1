#include "scene/surface_coverage_json.h"

#include <nlohmann/json.hpp>

namespace tessera {

nlohmann::ordered_json coverageToJson(const std::vector<SurfaceCoverage>& parts) {
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const SurfaceCoverage& part : parts)
    list.push_back({{"part", part.part}, {"pixels", part.pixels}, {"holes", part.holes}});
  return list;
}

}  // namespace tessera

// Writes coverage as JSON. It is part of a scene's tileset.json and of the result of an evaluation.
#pragma once

#include <nlohmann/json_fwd.hpp>

#include "scene/surface_coverage.h"

namespace tessera {

// Returns [{"part", "pixels", "holes"}, …].
nlohmann::ordered_json coverageToJson(const std::vector<SurfaceCoverage>& parts);

}  // namespace tessera

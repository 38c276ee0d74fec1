// Which tiles of a synthetic tree to draw and to hold in memory, for many views in sequence. Selectors in every
// language must make the same choices.
#pragma once

#include <nlohmann/json.hpp>

namespace tessera::golden {

// Returns {frame: {near, low, high}, tree: {columns, rows, backgroundBlock, tiles}, bytes, resources, bytesOfResources,
// views: [{camera, resident, budget, requested, refused, sharing, cut, backgroundBlock}]}. Lengths are in scene units.
// `cut` lists [tile, content] of the visible tiles, front to back.
nlohmann::ordered_json makeSelections();

}  // namespace tessera::golden

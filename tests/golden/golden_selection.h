// What to draw and what to have in memory of a made tree, for many views one after another: selectors in every language
// must say the same.
#pragma once

#include <nlohmann/json.hpp>

namespace tessera::golden {

// {frame: {near, low, high}, tree: {columns, rows, surround, tiles}, bytes, views: [{camera, held, budget, wanted,
// refused, cut, surround}]}; lengths in scene units, cut: [tile, content] of what is visible, front to back.
nlohmann::ordered_json makeSelections();

}  // namespace tessera::golden

// Decodes block grids from arbitrary text: an accepted grid can be traversed, and written and read back.
#include <cmath>
#include <cstdlib>
#include <nlohmann/json.hpp>
#include <string_view>

#include "scene/block_grid_json.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  const auto grid = tessera::blockGridFromJson(nlohmann::json::parse(text, nullptr, false));
  if (!grid) return 0;
  if (grid->cells() < 1 || grid->cells() > tessera::kMaxBlocks || !(grid->edge > 0)) std::abort();
  const int cell = grid->cellAt(grid->inGrid(grid->originInWorld).head<2>());
  if (cell < 0 || cell >= grid->cells() || !grid->centre(cell).allFinite()) std::abort();
  if (!tessera::blockGridFromJson(tessera::blockGridToJson(*grid))) std::abort();
  return 0;
}

// Warns of images that were rendered coarser than requested.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>

#include "base/file.h"
#include "scene/view_renderer.h"

namespace tessera {

// Renders with `renderer`, of whose last image `countRefused` returns the tiles that did not fit into `budgetBytes`;
// warns once if there are any. `place`: of the scene or world.
std::unique_ptr<ViewRenderer> withWarnings(const fs::path& place, uint64_t budgetBytes, bool showsOutside,
                                           std::unique_ptr<ViewRenderer> renderer,
                                           std::function<size_t()> countRefused);

}  // namespace tessera

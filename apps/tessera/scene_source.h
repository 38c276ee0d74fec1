// Scenes as something that can be drawn, without anything that trains.
#pragma once

#include "apps/tessera/drawable.h"

namespace tessera {

// Of a scene's contents, where nothing is said: half of the memory that they lie in, a card's own or the machine's.
uint64_t sceneBudgetBytes(const Device& device);

// Throws Error when the folder holds no scene, the scene has no such level, or its coarsest does not fit. Warns when a
// picture was drawn coarser than asked for, as memory was short.
std::unique_ptr<Drawable> openScene(const Device& device, const fs::path& folder, const DrawableOptions& options);

}  // namespace tessera

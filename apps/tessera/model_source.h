// Opens trained models, of any method, as render sources.
#pragma once

#include "apps/tessera/render_source.h"

namespace tessera {

// Throws Error if the folder holds no trained model or one that cannot be read. Keeps a reference to `device`.
std::unique_ptr<RenderSource> openModel(Device& device, const fs::path& folder);

}  // namespace tessera

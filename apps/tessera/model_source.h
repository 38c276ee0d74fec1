// Trained models as something that can be drawn, whatever their method.
#pragma once

#include "apps/tessera/drawable.h"

namespace tessera {

// Throws Error when the folder holds no trained model, or one that cannot be read. Keeps a reference to `device`.
std::unique_ptr<Drawable> openModel(Device& device, const fs::path& folder);

}  // namespace tessera

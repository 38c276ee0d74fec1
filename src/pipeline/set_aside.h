// Results that took long and are to be replaced by others.
#pragma once

#include "base/file.h"

namespace tessera {

// Renames a folder to FOLDER.earlier, or FOLDER.earlier-2 and so on, and says so; does nothing if there is none. Throws
// Error if it cannot be renamed.
void setAside(const fs::path& folder);

}  // namespace tessera

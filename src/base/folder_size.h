// How much disk a folder takes.
#pragma once

#include <cstdint>

#include "base/file.h"

namespace tessera {

// Returns the bytes of the files below a folder that removing it would free: without those that have other links. Those
// up to an error, if the folder cannot be read, and 0 if it is not there.
int64_t bytesBelow(const fs::path& folder);

}  // namespace tessera

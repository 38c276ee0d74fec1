// For tests that read the project's own files.
#pragma once

#include "base/file.h"

namespace tessera {

inline const fs::path kProject = TESSERA_PROJECT;

}  // namespace tessera

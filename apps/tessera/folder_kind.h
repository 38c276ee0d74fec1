// Detects what a folder given on the command line contains.
#pragma once

#include "base/file.h"

namespace tessera {

enum class FolderKind { other, source, capture, model, scene };

FolderKind kindOfFolder(const fs::path& folder);

}  // namespace tessera

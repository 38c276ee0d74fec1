// What a folder that was named holds.
#pragma once

#include "base/file.h"

namespace tessera {

enum class FolderKind { other, source, capture, model, scene };

FolderKind kindOfFolder(const fs::path& folder);

}  // namespace tessera

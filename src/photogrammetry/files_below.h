// The files of a folder that a user names.
#pragma once

#include <vector>

#include "base/file.h"

namespace tessera {

// The regular files of `folder` and its subfolders, in no order. Symbolic links are followed, each folder once, as they
// can lead in circles; files and folders whose names begin with a dot are left out, and those named @eaDir. Throws
// Error if a folder cannot be listed, or a disk fails to tell of a file: a shorter list would be taken for another one.
std::vector<fs::path> filesBelow(const fs::path& folder);

}  // namespace tessera

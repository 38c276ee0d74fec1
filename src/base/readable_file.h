// Tells files that are not there from those that a disk or a network fails to give for now.
#pragma once

#include <system_error>

#include "base/file.h"

namespace tessera {

// Whether an error means that a file is not there, or may not be opened, rather than that this cannot be told.
bool meansAbsence(const std::error_code& error);

// Whether this is a file that may be opened; links are followed. Throws Error if that cannot be told.
bool isReadableFile(const fs::path& path);

}  // namespace tessera

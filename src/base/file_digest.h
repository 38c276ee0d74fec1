// Tells files apart by what they contain.
#pragma once

#include <string>

#include "base/file.h"

namespace tessera {

// Returns a digest of the size of a file and of its first and last 64 KiB, 16 hexadecimal digits: enough to tell
// pictures apart, whatever their names and times, without reading all of them. "-" if there is no such file, or it may
// not be opened. Throws Error if it cannot be read for another reason, such as a disk that is away.
std::string fileDigest(const fs::path& path);

}  // namespace tessera

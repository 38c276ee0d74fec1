// What killed processes leave beside files and folders that they were writing.
#pragma once

#include <string>

#include "base/file.h"

namespace tessera {

// Ends the name of a file that holds bytes until they are copied into the one that is written: PLACE.partial-PID-bytes.
inline constexpr const char* kSpooled = "-bytes";
// Ends the name of what is replaced, until that has been done.
inline constexpr const char* kReplaced = "-old";

// Returns where this process writes what appears at `place` when it is complete: PLACE.partial-PID.
fs::path partialPlace(const fs::path& place);

// Removes what killed processes left next to `place`: PLACE.partial-PID, and the like. What was being replaced is put
// back if nothing is at `place`.
void removeLeftovers(const fs::path& place);

}  // namespace tessera

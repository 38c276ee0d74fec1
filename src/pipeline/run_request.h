// What a run is asked for.
#pragma once

#include <string>

#include "pipeline/photo_run.h"

namespace tessera {

// Throws Error naming what to change if there are no photos, if --frames or --holdout do not fit, or if files would be
// written among the photos or over what no run has made.
void requireUsableRequest(const PhotoRunOptions& options);

// The command with all that has been asked for.
std::string describeRequest(const PhotoRunOptions& options);

// Whether a path is a folder or lies in it.
bool liesIn(const fs::path& path, const fs::path& folder);

}  // namespace tessera

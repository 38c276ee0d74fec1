// What a run is asked for.
#pragma once

#include <set>
#include <string>

#include "pipeline/photo_run.h"

namespace tessera {

// Throws Error naming what to change if there are no photos, if --frames or --holdout do not fit, or if files would be
// written among the photos or over what no run has made.
void requireUsableRequest(const PhotoRunOptions& options);

// What run.json keeps of what has been asked for.
RunRequest describeRequest(const PhotoRunOptions& options);

// Replaces those options of --frames, --masks, --method, --minutes, --steps, --downscale, --holdout and --device that
// are not in `given` by those of the last run in the folder, and says so if they differ. Throws Error if run.json
// states one that is none.
void adoptEarlierFlags(PhotoRunOptions& options, const std::set<std::string>& given);

// Whether a path is a folder or lies in it.
bool liesIn(const fs::path& path, const fs::path& folder);

// Returns the rule of held-out photos with what its list contains. Throws Error if the list cannot be read.
std::string describeHoldOut(const std::string& rule);

}  // namespace tessera

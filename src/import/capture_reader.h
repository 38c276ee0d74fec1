// Reads the capture folders that scene/capture_writer.h writes, exactly.
#pragma once

#include "base/file.h"
#include "scene/capture.h"

namespace tessera {

// Throws Error if the folder was not written by writeCapture (other sources must be imported first), or if a photo is
// missing.
Capture readCapture(const fs::path& folder);

// Returns whether the folder's transforms.json was written by writeCapture.
bool isCapture(const fs::path& folder);

}  // namespace tessera

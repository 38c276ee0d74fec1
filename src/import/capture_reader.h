// Reads what scene/capture_writer.h wrote, exactly.
#pragma once

#include "base/file.h"
#include "scene/capture.h"

namespace tessera {

// Throws Error when the folder is no capture of ours (a source is imported first), or when a photo is missing.
Capture readCapture(const fs::path& folder);

// Whether the folder's transforms.json is one of ours.
bool isCapture(const fs::path& folder);

}  // namespace tessera

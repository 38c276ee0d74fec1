// Writes a capture folder: transforms.json (nerfstudio keys, ours under "tessera"), points.ply,
// observations.safetensors. Pictures are not touched; their paths are written relative to `capture.root`.
// Read back by import/capture_reader.h.
#pragma once

#include "scene/capture.h"

namespace tessera {

// Everything is written beside and renamed, transforms.json last: a folder with it is complete.
void writeCapture(const Capture& capture);

}  // namespace tessera

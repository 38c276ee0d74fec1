// The verb `import`: photographs with poses, in any format that is read here, to a capture folder of our own.
//
// Formats: COLMAP text and binary; transforms.json of nerfstudio, instant-ngp and Blender; our own captures.
//
// What the wild does, and what comes of it:
//   photo named but missing, unreadable, named twice, truncated      dropped, one warning each kind
//   photo of another size than its camera, same shape                the lens is scaled; other shape: dropped, warning
//   pose not a number or not rigid, path that leaves the folder      dropped, warning
//   mask or depth missing or unreadable                              the photo stays without it, warning
//   model or JSON damaged, counts absurd, no usable photo left       Error
//
// The result is self-contained: images/, masks/ (black = do not train), depths/ (EXR), transforms.json, points.ply,
// observations.safetensors; see scene/capture_writer.h. Run again after a kill, it goes on where it was:
// transforms.json is written last, and sources.txt says which pictures may be kept (picture_origins.h).
#pragma once

#include <string>

#include "base/file.h"
#include "scene/capture.h"

namespace tessera {

struct ImportOptions {
  int downscale = 1;  // divides width and height, averaging over area
  // every:N, list:FILE or none (see holdout.h); auto: the source's own split, else every:8. A source with a validation
  // but no test split is judged on the former.
  std::string holdout = "auto";
  int threads = 0;  // 0: all
};

// Throws Error, one that says which commands to run when `source` is a plain folder of photos.
Capture importCapture(const fs::path& source, const fs::path& out, const ImportOptions& options = {});

// What a folder was taken for: "COLMAP model", "transforms.json", ...; empty when it is none of them.
std::string sourceFormat(const fs::path& source);

}  // namespace tessera

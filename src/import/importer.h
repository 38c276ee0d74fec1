// The command `import`: converts posed photographs in any supported format into a capture folder.
//
// Formats: COLMAP text and binary; transforms.json of nerfstudio, instant-ngp and Blender; our own captures.
//
// Faults of a source, and their consequences:
//   photo missing, unreadable, named twice or truncated              dropped, one warning for each kind
//   photo of another size than its camera                            same aspect ratio: the lens is scaled, warning;
//                                                                    another one: dropped, warning
//   pose not finite or not rigid, path that leaves the folder        dropped, warning
//   mask or depth map missing or unreadable                          the photo is imported without it, warning
//   mask command that fails or writes no usable mask                 Error
//   model or JSON damaged, counts implausible, no usable photo left  Error
//
// The result is self-contained: images/, masks/ (black = do not train), depths/ (EXR), transforms.json, points.ply,
// observations.safetensors; see scene/capture_writer.h. An import that was killed resumes when it is run again:
// transforms.json is written last, and sources.txt records which images can be reused (picture_origins.h).
#pragma once

#include <functional>
#include <set>
#include <string>

#include "base/file.h"
#include "scene/capture.h"

namespace tessera {

struct SourceCapture;

struct ImportOptions {
  int downscale = 1;  // divides width and height, averaging over area
  // every:N, list:FILE or none (see holdout.h); auto: the source's own split, else every:8. A source with a validation
  // split but no test split is evaluated on the former.
  std::string holdout = "auto";
  int threads = 0;  // 0: all
  // MaskCommand: run for each photo as it is stored, one after another. Masks of the source apply, too. Empty: none.
  std::string maskCommand;
  // Called before each photo, from several threads. What it throws ends the import, which resumes when run again.
  std::function<void()> look = [] {};
  // Called once, with the names in the source of those photos that the capture lacks.
  std::function<void(const std::set<std::string>&)> dropped = [](const std::set<std::string>&) {};
};

// Throws Error if `source` cannot be imported; if it is a plain folder of photos, the error names the commands to run.
Capture importCapture(const fs::path& source, const fs::path& out, const ImportOptions& options = {});

// The same for photos with poses that are in memory. `from` names them in messages. Throws Error as above, but does not
// check `options`.
Capture importSource(SourceCapture source, const std::string& from, const fs::path& out, const ImportOptions& options);

// Reads photos with poses in any supported format. Throws Error as importCapture.
SourceCapture readSourceCapture(const fs::path& source);

// Returns the format that a folder is recognised as: "COLMAP model", "transforms.json", ...; empty if no format
// matches.
std::string sourceFormat(const fs::path& source);

}  // namespace tessera

// `tessera export --format merf`: exports a `volume` scene for the public web viewer of MERF. merf_layout.h documents
// the layout of its files; docs/user-guide.md lists how its images differ from ours.
#pragma once

#include "base/file.h"
#include "representations/volume/content/volume_content.h"

namespace tessera {

struct MerfExport {
  uint64_t bytesOnDisk = 0;
  uint32_t macroblocks = 0, slices = 0;
  double near = 0;  // the scene's, in the viewer's units; the viewer does not read it from the files
};

// Writes the folder `out` atomically; it may replace an older export. Throws Error unless `scene` is a baked scene of
// one contracted block with MERF's network (34 → 16 → 16 → 3) whose plane and voxel resolutions are multiples of 512
// and 32, and if `out` holds something else.
MerfExport exportMerf(const fs::path& scene, const fs::path& out);

// Writes the files of a content that satisfies these conditions into an existing folder. MERF's unit is the part's
// scale, its origin the part's centre.
MerfExport writeMerf(const VolumeContent& content, const fs::path& folder);

}  // namespace tessera

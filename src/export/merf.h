// `tessera export --format merf`: a `volume` scene for the public web viewer of MERF. merf_layout.h says how its files
// are laid out, docs/user-guide.md what its pictures differ in from ours.
#pragma once

#include "base/file.h"
#include "representations/volume/content/volume_content.h"

namespace tessera {

struct MerfExport {
  uint64_t bytesOnDisk = 0;
  uint32_t macroblocks = 0, slices = 0;
  double near = 0;  // the scene's, in units of the viewer, which does not read it from the files
};

// The folder `out` appears whole, in place of an older export. Throws Error where `scene` is no baked scene of one
// contracted block, whose network is MERF's (34 → 16 → 16 → 3) and whose planes and voxels are multiples of 512 and 32,
// or where `out` holds something else.
MerfExport exportMerf(const fs::path& scene, const fs::path& out);

// The files of a content that has just that, into an existing folder. MERF's unit is the part's scale, its origin the
// part's centre.
MerfExport writeMerf(const VolumeContent& content, const fs::path& folder);

}  // namespace tessera

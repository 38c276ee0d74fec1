// `tessera export --format mobilenerf`: exports a level of detail of a `mesh` scene for the viewer of MobileNeRF's
// authors (Chen et al. 2023), whose network is fitted to the decoders of the scene (mobilenerf_refit.h).
//
// The files, as that viewer reads them:
//   shape<N>.obj            triangles with places in the textures; v is 1 in the first row
//   shape<N>.pngfeat0.png   features 0 to 3 of texels as red, green, blue and alpha; transparent where red is 0
//   shape<N>.pngfeat1.png   features 4 to 7
//   mlp.json                the network, [inputs][outputs] for each layer, and the number of shapes
// Alpha has 7 bits, as 128 to 255 (encodeViewerFeature). Textures are sampled without filter. The viewer draws without
// blending into a buffer of twice the width and height of the image, takes the mean of 2 × 2 features and directions,
// and evaluates the network once for each pixel. Its axes are x, z and -y of the scene's, and its network takes the
// direction from the camera in the scene's axes.
#pragma once

#include "base/file.h"
#include "export/mobilenerf_refit.h"
#include "tiles/tileset.h"

namespace tessera {

struct MobilenerfExportSettings {
  uint32_t level = 0;     // of detail; 0 is the finest
  int refitSteps = 4000;  // of training the network
  int threads = 0;        // 0: as many as the machine has
};

struct MobilenerfExport {
  uint64_t bytesOnDisk = 0, triangles = 0;
  uint32_t shapes = 0, decoders = 0;  // of the scene, which the network replaces
  RefitError refit;
};

// From the scene to the positions in the files: the blocks lie between -1 and 1 along x and z.
Similarity viewerFromScene(const Tileset& tileset);

// Writes the folder `out`, whose name must end in `_phone`, as the viewer expects; it appears complete or not at all,
// and may replace an older export. Texels are opaque from an opacity of one half on. There is no sky. Each content is
// read twice, and one is in memory at a time. Throws Error unless `scene` is a scene of mesh that has this level.
MobilenerfExport exportMobilenerf(const fs::path& scene, const fs::path& out,
                                  const MobilenerfExportSettings& settings = {});

}  // namespace tessera

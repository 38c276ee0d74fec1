// `tessera bake`: a trained volume model to a scene of tiles.
#pragma once

#include <functional>

#include "representations/volume/alive_texels.h"
#include "representations/volume/volume_model.h"
#include "scene/capture.h"
#include "tiles/tileset.h"
#include "tiles/volume_content.h"

namespace tessera {

struct BakeVolumeOptions {
  // What training photos see is kept: samples of their pixels whose weight in the picture and whose opacity over a
  // renderer's step are both above these.
  double minWeight = 0.005, minAlpha = 0.005;
  int stride = 1;  // every so manieth pixel along rows and columns
  int effort = 4;  // of compression, 0 to 9
  std::function<void(int64_t done, int64_t all)> onPhoto = [](int64_t, int64_t) {};
};

struct BakedVolume {
  Tileset tileset;
  uint64_t bytesOnDisk = 0, bytesInMemory = 0;
  uint64_t macroblocks = 0;
};

// Writes the scene folder; tileset.json last. A function of model, capture and options. Throws Error when a file cannot
// be written.
BakedVolume bakeVolume(VolumeModel& model, const Capture& capture, const fs::path& scene,
                       const BakeVolumeOptions& options);

// The steps of it. What training photos see, [blocks].
std::vector<AliveTexels> findAliveTexels(VolumeModel& model, const Capture& capture, const BakeVolumeOptions& options);
VolumeContent bakeBlock(VolumeModel& model, uint32_t block, const AliveTexels& alive);

}  // namespace tessera

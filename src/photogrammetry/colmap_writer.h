// Writes sparse models as COLMAP's programs read them.
// Source: COLMAP's documentation of its output format (cameras.bin, images.bin, points3D.bin).
#pragma once

#include "import/colmap_model.h"

namespace tessera {

// Writes a model into a folder, which is made if need be. Tracks follow from the keypoints of the images; cameras whose
// lens cannot be read are left out. The points are written last, so that a model that has them is whole. Throws Error
// if a file cannot be written.
void writeColmapModel(const ColmapModel& model, const fs::path& folder);

}  // namespace tessera

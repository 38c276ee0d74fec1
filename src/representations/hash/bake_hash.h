// A trained `hash` model to what a renderer needs of it (NGP-RT, section 4.1; the specification's section 6).
#pragma once

#include <functional>

#include "representations/hash/hash_model.h"
#include "scene/capture.h"
#include "tiles/hash_content.h"

namespace tessera {

struct BakeHashOptions {
  // What training photos see is kept: samples of their pixels whose weight in the picture and whose opacity are both
  // above these (MERF's).
  double minWeight = 0.005, minAlpha = 0.005;
  int stride = 1;      // every so manieth pixel along rows and columns
  int dilation = 1;    // cells around those that are seen are kept, too
  uint32_t cells = 0;  // of a block's occupancy along an edge; 0: as many as the lattice has corners
  std::function<void(int64_t done, int64_t all)> onPhoto = [](int64_t, int64_t) {};
};

// The steps of it. Which cells of each block hold anything that a training photo sees through pixels that no mask
// leaves out, dilated: [blocks]. Throws Error when a mask cannot be read.
std::vector<OccupancyBits> findSeenCells(HashModel& model, const Capture& capture, const BakeHashOptions& options);
// A block's features as bytes: of the lattice's corners around seen cells, of the tables' entries all.
HashPart bakeHashPart(HashModel& model, uint32_t block, const OccupancyBits& seen);
// One block, or the surround, alone. Throws Error for a model that mixes levels by a network for each sample.
HashContent bakeHashBlock(HashModel& model, uint32_t block, const OccupancyBits& seen);

}  // namespace tessera

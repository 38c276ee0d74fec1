// Rays for one training step: which pixels, and what colour they should have.
#pragma once

#include "base/threads.h"
#include "scene/capture.h"
#include "train/known_distances.h"
#include "train/photo_tiles.h"
#include "train/photo_window.h"

namespace tessera {

struct RayBatch {
  std::vector<uint32_t> photoOfRay;  // index into Capture::photos
  std::vector<float> pixels;         // [rays][2]
  std::vector<float> targets;        // [rays][3], sRGB in [0,1]; transparent photos over `backgrounds`
  std::vector<float> backgrounds;    // [rays][3]
  std::vector<float> weights;        // [rays]: 0 where a mask says so
  std::vector<float> jitter;         // [rays], in [0,1)
  std::vector<float> distances;      // [rays]: where the ray's surface is known to be, scene units; 0: not known
};

struct RayBatchOptions {
  uint64_t seed = 0;
  bool randomBackground = true;
  double knownShare = 0;  // of the rays go through pixels whose distance is known, in photos that have some
  const std::vector<TileShares>* tiles = nullptr;  // [photo]: draw from these alone
};

// Uniform over the window's photos and their pixels, or by the shares of tiles; a function of window, seed and step,
// whatever the pool's threads.
// Masked pixels are drawn again a few times before they are kept with weight zero; where no photo of the window has a
// tile, all rays have that weight.
// `known` is by photo, and may be empty.
void drawRays(const std::vector<PhotoWindow::Entry>& window, const std::vector<std::vector<KnownDistance>>& known,
              const RayBatchOptions& options, int64_t step, uint32_t rays, ThreadPool& pool, RayBatch& batch);

}  // namespace tessera

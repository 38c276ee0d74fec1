// Draws the rays of one training step: their pixels and target colours.
#pragma once

#include "base/threads.h"
#include "scene/capture.h"
#include "train/photo_tiles.h"
#include "train/photo_window.h"
#include "train/sparse_depth.h"

namespace tessera {

struct RayBatch {
  std::vector<uint32_t> photoOfRay;  // index into Capture::photos
  std::vector<float> pixels;         // [rays][2]
  std::vector<float> targets;        // [rays][3], sRGB in [0,1]; transparent photos over `backgrounds`
  std::vector<float> backgrounds;    // [rays][3]
  std::vector<float> weights;        // [rays], 0 for masked pixels, else 1
  std::vector<float> opaqueWeights;  // [rays], as weights, but 0 also for pixels that are not opaque
  std::vector<float> jitter;         // [rays], in [0,1)
  std::vector<float> distances;      // [rays], sparse depth along the ray, scene units; 0: unknown
};

struct RayBatchOptions {
  uint64_t seed = 0;
  bool randomBackground = true;
  double sparseDepthRayFraction = 0;               // share of the rays through sparse points, in photos that have some
  const std::vector<TileShares>* tiles = nullptr;  // [photo], draw from these tiles only; null: from whole photos
  // Rays are drawn as squares of square² neighbouring pixels, one after another. A pixel is drawn as for single rays,
  // and the square is one of those around it. Squares are not drawn through sparse points, and their masked pixels are
  // not redrawn.
  uint32_t square = 1;
};

// Draws uniformly over the photos of the window and their pixels, or by the shares of tiles. The result is a function
// of the window, the seed and the step, independent of the number of threads. Masked pixels are redrawn a few times
// before they are accepted with weight zero; if no photo of the window has a tile, all rays have weight zero. `known`:
// the sparse depths, [photo]; may be empty.
void drawRays(const std::vector<PhotoWindow::Entry>& window, const std::vector<std::vector<SparseDepth>>& known,
              const RayBatchOptions& options, int64_t step, uint32_t rays, ThreadPool& pool, RayBatch& batch);

}  // namespace tessera

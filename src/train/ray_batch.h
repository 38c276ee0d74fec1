// Rays for one training step: which pixels, and what colour they should have.
#pragma once

#include "scene/capture.h"
#include "train/photo_window.h"

namespace tessera {

struct RayBatch {
  std::vector<uint32_t> photoOfRay;  // index into Capture::photos
  std::vector<float> pixels;         // [rays][2]
  std::vector<float> targets;        // [rays][3], sRGB in [0,1]; transparent photos over `backgrounds`
  std::vector<float> backgrounds;    // [rays][3]
  std::vector<float> weights;        // [rays]: 0 where a mask says so
  std::vector<float> jitter;         // [rays], in [0,1)
};

// Uniform over the window's photos and their pixels; a function of window, seed and step. Masked pixels are drawn again
// a few times before they are kept with weight zero.
void drawRays(const std::vector<PhotoWindow::Entry>& window, uint64_t seed, int64_t step, uint32_t rays,
              bool randomBackground, RayBatch& batch);

}  // namespace tessera

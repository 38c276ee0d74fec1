#include "train/ray_batch.h"

#include "base/check.h"
#include "base/random.h"

namespace tessera {

void drawRays(const std::vector<PhotoWindow::Entry>& window, const std::vector<std::vector<KnownDistance>>& known,
              const RayBatchOptions& options, int64_t step, uint32_t rays, RayBatch& batch) {
  CHECK(!window.empty());
  constexpr int kTries = 4;
  constexpr uint64_t kDrawsPerRay = 32;
  batch.photoOfRay.resize(rays);
  batch.pixels.resize(2 * size_t{rays});
  batch.targets.resize(3 * size_t{rays});
  batch.backgrounds.resize(3 * size_t{rays});
  batch.weights.resize(rays);
  batch.jitter.resize(rays);
  batch.distances.assign(rays, 0.0f);
  const RandomStream random(options.seed, 0x4a75 + (static_cast<uint64_t>(step) << 16));
  for (uint32_t ray = 0; ray < rays; ++ray) {
    uint64_t draw = kDrawsPerRay * ray;
    batch.jitter[ray] = random.uniform(draw++);
    float* background = &batch.backgrounds[3 * size_t{ray}];
    for (int k = 0; k < 3; ++k) background[k] = options.randomBackground ? random.uniform(draw + k) : 0.0f;
    draw += 3;
    const bool wantsKnown = random.uniform(draw++) < options.knownShare;
    for (int attempt = 0; attempt < kTries; ++attempt) {
      const PhotoWindow::Entry& entry = window[random.below(draw++, static_cast<uint32_t>(window.size()))];
      const ImageU8& image = entry.decoded->image;
      uint32_t x = random.below(draw++, static_cast<uint32_t>(image.width));
      uint32_t y = random.below(draw++, static_cast<uint32_t>(image.height));
      batch.distances[ray] = 0;
      if (wantsKnown && !known.empty() && !known[entry.photo].empty()) {
        const std::vector<KnownDistance>& ofPhoto = known[entry.photo];
        const KnownDistance& chosen = ofPhoto[random.below(draw++, static_cast<uint32_t>(ofPhoto.size()))];
        if (chosen.x < static_cast<uint32_t>(image.width) && chosen.y < static_cast<uint32_t>(image.height)) {
          x = chosen.x;
          y = chosen.y;
          batch.distances[ray] = chosen.distance;
        }
      }
      const bool masked =
          !entry.decoded->mask.empty() && *entry.decoded->mask.at(static_cast<int>(x), static_cast<int>(y)) < 128;
      batch.weights[ray] = masked ? 0.0f : 1.0f;
      if (masked && attempt + 1 < kTries) continue;
      batch.photoOfRay[ray] = static_cast<uint32_t>(entry.photo);
      batch.pixels[2 * size_t{ray}] = static_cast<float>(x) + 0.5f;
      batch.pixels[2 * size_t{ray} + 1] = static_cast<float>(y) + 0.5f;
      const uint8_t* pixel = image.at(static_cast<int>(x), static_cast<int>(y));
      const float alpha = image.channels == 4 ? static_cast<float>(pixel[3]) / 255 : 1.0f;
      if (masked || alpha < 1) batch.distances[ray] = 0;  // what is known is not what the photo shows there
      for (int k = 0; k < 3; ++k) {
        const float value = static_cast<float>(pixel[image.channels >= 3 ? k : 0]) / 255;
        batch.targets[3 * size_t{ray} + k] = value * alpha + background[k] * (1 - alpha);
      }
      break;
    }
  }
}

}  // namespace tessera

#include "train/ray_batch.h"

#include <algorithm>
#include <optional>

#include "base/check.h"
#include "base/random.h"

namespace tessera {

namespace {

// Draws tiles from the photos of a window by their shares.
class TileDraw {
 public:
  TileDraw(const std::vector<PhotoWindow::Entry>& window, const std::vector<TileShares>& tiles) : tiles_(tiles) {
    for (const PhotoWindow::Entry& entry : window) {
      until_.push_back((until_.empty() ? 0 : until_.back()) + tiles[static_cast<size_t>(entry.photo)].total());
      photos_.push_back(static_cast<size_t>(entry.photo));
    }
  }
  bool isEmpty() const { return !(until_.back() > 0); }
  bool holds(int photo, const SparseDepth& pixel) const {
    const std::vector<PhotoTile>& tiles = tiles_[static_cast<size_t>(photo)].tiles;
    const auto below =
        std::partition_point(tiles.begin(), tiles.end(), [&](const PhotoTile& tile) { return tile.top <= pixel.y; });
    if (below == tiles.begin()) return false;
    const uint32_t top = std::prev(below)->top;  // of the row that may contain the pixel
    const auto behind = std::partition_point(
        tiles.begin(), below, [&](const PhotoTile& tile) { return tile.top < top || tile.left <= pixel.x; });
    if (behind == tiles.begin()) return false;
    const PhotoTile& tile = *std::prev(behind);
    return tile.top == top && pixel.x >= tile.left && pixel.x < tile.right && pixel.y < tile.bottom;
  }
  struct Drawn {
    size_t entry;
    const PhotoTile* tile;
  };
  // `u` in [0,1).
  Drawn at(double u) const {
    const double target = u * until_.back();
    const size_t entry = findShareIndex(until_, target);
    const TileShares& ofPhoto = tiles_[photos_[entry]];
    return {entry, &ofPhoto.tiles[findShareIndex(ofPhoto.until, target - (entry > 0 ? until_[entry - 1] : 0))]};
  }

 private:
  static size_t findShareIndex(const std::vector<double>& until, double target) {
    size_t place = static_cast<size_t>(std::upper_bound(until.begin(), until.end(), target) - until.begin());
    place = std::min(place, until.size() - 1);
    while (place > 0 && until[place] == until[place - 1]) --place;  // rounding must not select an entry without a share
    return place;
  }

  const std::vector<TileShares>& tiles_;
  std::vector<size_t> photos_;
  std::vector<double> until_;  // [window]
};

}  // namespace

void drawRays(const std::vector<PhotoWindow::Entry>& window, const std::vector<std::vector<SparseDepth>>& known,
              const RayBatchOptions& options, int64_t step, uint32_t rays, ThreadPool& pool, RayBatch& batch) {
  CHECK(!window.empty());
  constexpr int kTries = 4, kPicks = 2;
  constexpr uint64_t kDrawsPerRay = 32;
  constexpr size_t kRaysPerTask = 512;
  batch.photoOfRay.resize(rays);
  batch.pixels.resize(2 * size_t{rays});
  batch.targets.resize(3 * size_t{rays});
  batch.backgrounds.resize(3 * size_t{rays});
  batch.weights.resize(rays);
  batch.opaqueWeights.resize(rays);
  batch.jitter.resize(rays);
  batch.distances.assign(rays, 0.0f);
  std::optional<TileDraw> tiles;
  if (options.tiles) tiles.emplace(window, *options.tiles);
  const bool nothing = tiles && tiles->isEmpty();
  const RandomStream random(options.seed, 0x4a75 + (static_cast<uint64_t>(step) << 16));
  const size_t pixelsOfSquare = size_t{options.square} * options.square;
  const auto drawRay = [&](size_t ray) {
    uint64_t draw = kDrawsPerRay * ray;
    const uint32_t inSquare = static_cast<uint32_t>(ray % pixelsOfSquare);
    batch.jitter[ray] = random.uniform(draw++);
    float* background = &batch.backgrounds[3 * ray];
    for (int k = 0; k < 3; ++k) background[k] = options.randomBackground ? random.uniform(draw + k) : 0.0f;
    draw += 3;
    const bool wantsKnown = options.square == 1 && random.uniform(draw) < options.sparseDepthRayFraction;
    draw = kDrawsPerRay * (ray - inSquare) + 5;  // all rays of a square use the same numbers
    for (int attempt = 0; attempt < kTries; ++attempt) {
      const PhotoTile* tile = nullptr;
      size_t chosenEntry = 0;
      if (tiles && !nothing) {
        const TileDraw::Drawn drawn = tiles->at(random.uniformDouble(draw++));
        chosenEntry = drawn.entry;
        tile = drawn.tile;
      } else {
        chosenEntry = random.below(draw++, static_cast<uint32_t>(window.size()));
      }
      const PhotoWindow::Entry& entry = window[chosenEntry];
      const ImageU8& image = entry.decoded->image;
      const uint32_t left = tile ? tile->left : 0, top = tile ? tile->top : 0;
      const uint32_t right = tile ? tile->right : static_cast<uint32_t>(image.width);
      const uint32_t bottom = tile ? tile->bottom : static_cast<uint32_t>(image.height);
      uint32_t x = left + random.below(draw++, right - left);
      uint32_t y = top + random.below(draw++, bottom - top);
      if (options.square > 1) {
        const auto within = [&](uint32_t pixel, uint32_t place, int size) {
          const int first = static_cast<int>(pixel) - static_cast<int>(random.below(draw++, options.square));
          const int last = std::max(0, size - static_cast<int>(options.square));  // of the squares in the image
          return std::min(static_cast<uint32_t>(std::clamp(first, 0, last)) + place, static_cast<uint32_t>(size) - 1);
        };
        x = within(x, inSquare % options.square, image.width);
        y = within(y, inSquare / options.square, image.height);
      }
      batch.distances[ray] = 0;
      const bool someKnown = wantsKnown && !nothing && !known.empty() && !known[entry.photo].empty();
      for (int pick = 0; someKnown && pick < kPicks; ++pick) {
        const std::vector<SparseDepth>& ofPhoto = known[entry.photo];
        const SparseDepth& chosen = ofPhoto[random.below(draw++, static_cast<uint32_t>(ofPhoto.size()))];
        if (tiles && !tiles->holds(entry.photo, chosen)) continue;
        if (chosen.x < static_cast<uint32_t>(image.width) && chosen.y < static_cast<uint32_t>(image.height)) {
          x = chosen.x;
          y = chosen.y;
          batch.distances[ray] = chosen.distance;
        }
        break;
      }
      const bool masked =
          !entry.decoded->mask.empty() && *entry.decoded->mask.at(static_cast<int>(x), static_cast<int>(y)) < 128;
      batch.weights[ray] = masked || nothing ? 0.0f : 1.0f;
      if (masked && options.square == 1 && attempt + 1 < kTries) continue;
      batch.photoOfRay[ray] = static_cast<uint32_t>(entry.photo);
      batch.pixels[2 * ray] = static_cast<float>(x) + 0.5f;
      batch.pixels[2 * ray + 1] = static_cast<float>(y) + 0.5f;
      const uint8_t* pixel = image.at(static_cast<int>(x), static_cast<int>(y));
      const float alpha = image.channels == 4 ? static_cast<float>(pixel[3]) / 255 : 1.0f;
      batch.opaqueWeights[ray] = alpha < 1 ? 0.0f : batch.weights[ray];
      if (masked || alpha < 1) batch.distances[ray] = 0;  // the photo does not show the sparse point there
      for (int k = 0; k < 3; ++k) {
        const float value = static_cast<float>(pixel[image.channels >= 3 ? k : 0]) / 255;
        batch.targets[3 * ray + k] = value * alpha + background[k] * (1 - alpha);
      }
      break;
    }
  };
  pool.forRanges(rays, kRaysPerTask, [&](size_t begin, size_t end) {
    for (size_t ray = begin; ray < end; ++ray) drawRay(ray);
  });
}

}  // namespace tessera

#include "train/held_out_tiles.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "base/check.h"
#include "base/random.h"

namespace tessera {
namespace {

void add(TileShares& shares, const PhotoTile& tile) {
  const double pixels = static_cast<double>(tile.right - tile.left) * (tile.bottom - tile.top);
  shares.until.push_back(shares.total() + pixels);
  shares.tiles.push_back(tile);
}

// [tiles]: true for `count` of them.
std::vector<bool> drawnTiles(size_t tiles, size_t count, const RandomStream& random) {
  std::vector<size_t> order(tiles);
  std::iota(order.begin(), order.end(), size_t{0});
  std::vector<bool> drawn(tiles);
  for (size_t i = 0; i < count; ++i) {
    std::swap(order[i], order[i + random.below(i, static_cast<uint32_t>(tiles - i))]);
    drawn[order[i]] = true;
  }
  return drawn;
}

}  // namespace

HeldOutTiles holdOutTiles(const Capture& capture, double share, uint64_t seed) {
  CHECK(share > 0);
  CHECK(share < 1);
  HeldOutTiles made{std::vector<TileShares>(capture.photos.size()), std::vector<TileShares>(capture.photos.size())};
  for (const int photo : capture.photosIn(Split::train)) {
    const std::vector<PhotoTile> tiles = tilesOfPhoto(capture, photo);
    const size_t wanted = static_cast<size_t>(std::lround(share * static_cast<double>(tiles.size())));
    const size_t count = tiles.size() < 2 ? 0 : std::clamp(wanted, size_t{1}, tiles.size() - 1);
    const std::vector<bool> heldOut =
        drawnTiles(tiles.size(), count, RandomStream(seed, 0x4e1d + (static_cast<uint64_t>(photo) << 16)));
    for (size_t i = 0; i < tiles.size(); ++i) {
      add((heldOut[i] ? made.heldOut : made.trained)[static_cast<size_t>(photo)], tiles[i]);
    }
  }
  return made;
}

}  // namespace tessera

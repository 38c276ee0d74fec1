// A part of the training photos' pixels that is not trained on, by which settings can be judged without the photos that
// are held out for evaluation.
#pragma once

#include "train/photo_tiles.h"

namespace tessera {

// [photo] each; all pixels of the training photos stand in one of the two, and weigh the same.
struct HeldOutTiles {
  std::vector<TileShares> trained, heldOut;
};

// So great a share of each photo's tiles (PhotoTile), drawn at random; of a photo with two tiles or more, one at least
// and never all.
HeldOutTiles holdOutTiles(const Capture& capture, double share, uint64_t seed);

}  // namespace tessera

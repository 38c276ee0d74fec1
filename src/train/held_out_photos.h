// Holds out a part of the training photos, so that settings can be tuned without the photos that are held out for
// evaluation.
#pragma once

#include "train/photo_tiles.h"

namespace tessera {

// Where to draw rays from, [photo] each: every training photo lies as a whole in one of the two.
struct HeldOutPhotos {
  std::vector<TileShares> trained, heldOut;
};

// Holds out one training photo in `every`, in their order; `seed` decides which one is first. At least one photo is
// held out and never all. There must be at least two training photos.
HeldOutPhotos holdOutPhotos(const Capture& capture, uint32_t every, uint64_t seed);

}  // namespace tessera

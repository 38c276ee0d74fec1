// A part of the training photos that is not trained on, by which settings can be judged without the photos that are
// held out for evaluation.
#pragma once

#include "train/photo_tiles.h"

namespace tessera {

// [photo] each, to draw rays from: every training photo stands whole in one of the two.
struct HeldOutPhotos {
  std::vector<TileShares> trained, heldOut;
};

// One training photo of `every`, in their order, from a place on that `seed` decides; of two or more, at least one and
// never all. There must be two.
HeldOutPhotos holdOutPhotos(const Capture& capture, uint32_t every, uint64_t seed);

}  // namespace tessera

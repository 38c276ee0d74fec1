// Which blocks are in memory together while baking looks through the training photos, where not all of them fit: the
// stays of training (train/residency.h), one after another.
#pragma once

#include "train/photo_tiles.h"

namespace tessera {

class BakeStays {
 public:
  // `resident` of `cells` blocks at a time. A tile of a photo is looked through in the first stay that has all the
  // blocks that one sees through it. Where none has, in several that have them all between them: a block that is not
  // there hides nothing, so nearly all that the tile shows is kept, and some of what it does not show. Blocks that
  // would come to no stay of training's get more in the end. Sets end at the box: where border blocks are the surround,
  // what they hold outside of it is kept as far as they happen to be there.
  BakeStays(const TiledPhotos& photos, uint32_t cells, uint32_t resident);

  const std::vector<std::vector<uint32_t>>& stays() const { return stays_; }  // at most `resident` blocks each
  const std::vector<uint32_t>& staysOfSet(uint32_t set) const { return staysOfSet_[set]; }
  // The first of those that have most of these blocks.
  uint32_t bestFor(const std::vector<uint32_t>& blocks) const;
  double inParts() const { return inParts_; }  // share of the tiles that are looked through in several stays

 private:
  std::vector<uint32_t> cover(std::vector<uint32_t> blocks, uint32_t resident);

  std::vector<std::vector<uint32_t>> stays_;
  std::vector<std::vector<uint32_t>> staysOfSet_;
  double inParts_ = 0;
};

}  // namespace tessera

// The order in which blocks are in memory while baking visits the training photos, for models whose blocks do not all
// fit: the resident sets of training (train/residency.h), one after another.
#pragma once

#include "train/photo_tiles.h"

namespace tessera {

class BakeResidencySchedule {
 public:
  // At most `resident` of `cells` blocks are in memory at a time. A tile of a photo is visited with the first resident
  // set that has all the blocks visible through it. If no set has them all, the tile is visited with several that have
  // them all between them: a block that is not resident occludes nothing, so nearly everything that the tile shows is
  // marked, and also some of what is hidden from it. Blocks that no resident set of training contains get additional
  // sets at the end. The sets of blocks that a tile sees end at the scene's box: where border blocks serve as the
  // background block, what they hold outside the box is marked only as far as they happen to be resident.
  BakeResidencySchedule(const TiledPhotos& photos, uint32_t cells, uint32_t resident);

  // [sets]: at most `resident` blocks each.
  const std::vector<std::vector<uint32_t>>& residentSets() const { return residentSets_; }
  // The resident sets with which the tiles of a set of blocks (TiledPhotos::sets) are visited.
  const std::vector<uint32_t>& residentSetsForSet(uint32_t set) const { return residentSetsForSet_[set]; }
  // Returns the first resident set that contains the most of these blocks.
  uint32_t bestFor(const std::vector<uint32_t>& blocks) const;
  double inParts() const { return inParts_; }  // the fraction of tiles that are visited with several sets

 private:
  std::vector<uint32_t> cover(std::vector<uint32_t> blocks, uint32_t resident);

  std::vector<std::vector<uint32_t>> residentSets_;
  std::vector<std::vector<uint32_t>> residentSetsForSet_;
  double inParts_ = 0;
};

}  // namespace tessera

// poses/pairs.json: which photos are compared. The stage `pairs` writes it, and later ones read it.
#pragma once

#include <vector>

#include "base/file.h"
#include "photogrammetry/photo_pairs.h"

namespace tessera {

struct ChosenPairs {
  std::string photos;  // a digest of the photos that they are pairs of
  std::vector<PhotoPair> pairs;
  LookAlikes lookAlikes;
};

void writePairs(const fs::path& file, const ChosenPairs& chosen);

// Throws Error if the file is damaged, or not one of a list of so many photos.
ChosenPairs readPairs(const fs::path& file, size_t photos);

}  // namespace tessera

// Photos that look alike, by COLMAP's visual words: where neither GPS nor the sequence tells which photos show the same
// places.
// Source: Nistér and Stewénius, "Scalable recognition with a vocabulary tree", 2006; COLMAP 3.8, src/retrieval.
#pragma once

#include <string_view>

#include "photogrammetry/photo_list.h"
#include "photogrammetry/photo_pairs.h"

namespace tessera {

// Returns what `colmap vocab_tree_retriever` has printed, under the safe names of the photos. Lines and names that are
// not known are ignored; the result has a list for each photo, which may be empty.
LookAlikes parseLookAlikes(std::string_view text, const PhotoList& list);

}  // namespace tessera

// Tell whether what a run depends on has changed since it was last used: the photos, and results that other programs,
// such as `tessera train`, may change.
#pragma once

#include <string>
#include <vector>

#include "base/file.h"
#include "photogrammetry/photo_list.h"

namespace tessera {

// Returns a digest of the names and contents of photos: a copy of them has other times.
std::string photosDigest(const std::vector<ListedPhoto>& photos);

// Returns a digest of which photos are left out and why.
std::string leftOutDigest(const std::vector<LeftOutPhoto>& photos);

// Returns a digest of a model's settings, blocks, last checkpoint and coarser levels; empty if there is no model in the
// folder.
std::string modelDigest(const fs::path& model);

// Returns a digest of a scene, whose files are named by what they contain; empty if there is none in the folder.
std::string sceneDigest(const fs::path& scene);

}  // namespace tessera

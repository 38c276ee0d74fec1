// Folders of models that COLMAP has written, some of which may have been interrupted: their points are written last.
#pragma once

#include <cstdint>
#include <set>
#include <vector>

#include "base/file.h"

namespace tessera {

// A model with the photos in it, by the numbers that the database gives them, less 1: indices into the list.
struct Piece {
  fs::path folder;
  std::set<int> photos;
};

// Returns the photos of a model; nothing of one that was not written to its end.
std::set<int> photosIn(const fs::path& folder);

// Returns the readable models in a folder, the largest first.
std::vector<Piece> piecesIn(const fs::path& folder);

// Returns the number of records that a file of a model states, which it begins with; 0 if it is missing.
uint64_t statedCount(const fs::path& path);

// Returns the number of photos that a model states, without reading all of it; 0 if it was not written to its end.
uint64_t statedPhotos(const fs::path& folder);

// Throws ColmapKilled if a model in a folder, or the folder itself, was not written to its end: COLMAP does not notice
// that a disk or a quota is full.
void requireWhole(const fs::path& folder);

// The following throw Error if they cannot do so.
void removeFolder(const fs::path& folder);
void makeFolder(const fs::path& folder);
// Puts a folder in the place of another, which is there until then.
void replaceFolder(const fs::path& newFolder, const fs::path& target);

}  // namespace tessera

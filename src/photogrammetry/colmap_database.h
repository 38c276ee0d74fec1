// COLMAP's database.db of photos, features and matches. It is written only while no colmap runs.
// Source: COLMAP 3.8, src/base/database.cc.
#pragma once

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "base/file.h"
#include "photogrammetry/photo_list.h"
#include "photogrammetry/photo_pairs.h"

namespace tessera {

// Photo i of a list has the number i + 1 in the database, and body k the camera k + 1.
class ColmapDatabase {
 public:
  // Opens an existing database. Throws Error if it cannot be opened or is not COLMAP's.
  explicit ColmapDatabase(const fs::path& file);
  ~ColmapDatabase();
  ColmapDatabase(const ColmapDatabase&) = delete;
  ColmapDatabase& operator=(const ColmapDatabase&) = delete;

  // Writes cameras and photos, under their safe names. Cameras have a focal length from EXIF, which the mapper then
  // trusts at first, or 1.2 times the longer side, as COLMAP assumes. Rows that exist are kept.
  void addPhotos(const PhotoList& list);

  // The numbers of features by photo, for photos that were looked at.
  std::map<int, int> features() const;
  void removeMatches();
  // The numbers of matches that one geometry explains, for pairs that were compared.
  std::map<PhotoPair, int> inliers() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace tessera

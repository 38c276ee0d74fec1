// Features of photos and their matches: a folder with the photos under safe names and COLMAP's database. Each step goes
// on where it was interrupted.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "photogrammetry/colmap_program.h"
#include "photogrammetry/photo_list.h"
#include "photogrammetry/photo_pairs.h"

namespace tessera {

// Returns the pixels of a photo in which COLMAP looks for features: it reduces larger photos first.
int64_t extractedPixels(const CameraBody& body);
// Returns how many of `threads` (0: all of the machine's) can extract features in so many pixels at once, in so many
// bytes of memory: at least one.
int extractionThreads(int threads, int64_t pixels, int64_t memoryBytes);
// Returns the memory that so many of them take, in bytes.
int64_t extractionBytes(int threads, int64_t pixels);

// The reason that `explain` gives for photos of another model.
inline constexpr char kOfAnotherModel[] = "in another model, of another place or with too few matches to the rest";

class PhotoMatches {
 public:
  // `folder` is created when it is written to. `list` must outlive this object.
  PhotoMatches(fs::path folder, const PhotoList& list, ColmapSettings settings);

  // Called twice a second with the number of photos or pairs that are done. What it throws ends the program that runs.
  using Watch = std::function<void(int64_t done)>;

  // Photos that cannot be decoded get no features. Throws Error if none gets any, or if one cannot be read for now, as
  // from a disk that is away, which COLMAP passes over.
  void extractFeatures(const Watch& watch);
  // Removes features and matches, which belong to other photos. Throws Error if a file cannot be removed.
  void discard() const;
  // Returns for each of these photos those that look like it, and for others none. Features must have been extracted.
  LookAlikes findLookAlikes(const std::vector<int>& photos, const Watch& watch);
  void discardMatches() const;
  // Compares pairs that have not been compared yet.
  void match(const std::vector<PhotoPair>& pairs, const Watch& watch);
  struct Counts {
    int64_t photos = 0, features = 0;  // photos with features, and the features of all
    int64_t pairs = 0, inliers = 0;    // pairs that were compared, and the inliers of all
  };
  Counts count() const;        // of what was done so far; zeros before
  size_t linkedPairs() const;  // of those compared, the pairs that one geometry explains
  // Returns these photos with the likely reason why they are not in the model. `photos` are indices into the list, of
  // which those in `apart` are in another model.
  std::vector<LeftOutPhoto> explain(const std::vector<int>& photos, const std::vector<int>& apart) const;

 private:
  fs::path database() const { return folder_ / "database.db"; }
  // Whether the program has left out a photo that can be decoded. Throws Error if one cannot be read.
  bool missesPhotos() const;
  void runColmap(const char* step, std::vector<std::string> arguments, const std::function<void()>& look,
                 const std::function<bool()>& isDone = {});

  fs::path folder_;
  const PhotoList& list_;
  ColmapSettings settings_;
};

}  // namespace tessera

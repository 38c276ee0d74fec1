// Poses of photos by structure from motion: a folder with the photos under safe names, COLMAP's database and models.
// Each step goes on where it was interrupted.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "import/source.h"
#include "photogrammetry/photo_list.h"
#include "photogrammetry/photo_pairs.h"

namespace tessera {

struct ReconstructionOptions {
  int threads = 0;  // 0: all
  std::string colmap = "colmap";
};

class Reconstruction {
 public:
  // `folder` is created when it is written to. `list` must outlive this object.
  Reconstruction(fs::path folder, const PhotoList& list, ReconstructionOptions options);

  // Called now and then with the number of photos or pairs that are done.
  using Watch = std::function<void(int64_t done)>;

  void extractFeatures(const Watch& watch);
  // Removes features, matches and snapshots, which belong to other photos. Throws Error if a file cannot be removed.
  void discardFeatures() const;
  // Compares pairs that have not been compared yet.
  void match(const std::vector<PhotoPair>& pairs, const Watch& watch);
  size_t linkedPairs() const;  // of those compared, the pairs that one geometry explains
  // Estimates poses. `resumes`: goes on from the last snapshot of a call that was interrupted. Throws Error if no model
  // results.
  void map(bool resumes, const Watch& watch);
  // Adds photos to the largest model that further matches have connected with it.
  void extendMap(const Watch& watch);
  // Returns the photos that the largest model lacks, each with the likely reason.
  std::vector<LeftOutPhoto> unplaced() const;
  std::vector<int> unplacedPhotos() const;  // their indices
  // Returns the largest model, with photos under their own names.
  SourceCapture largestModel() const;

  int64_t peakBytes() const { return peakBytes_; }  // of the programs that it ran

 private:
  void makeFolder() const;
  void runMapper(const fs::path& input, const fs::path& output, const Watch& watch);
  void replaceModels(const fs::path& models) const;
  std::vector<int> placed() const;
  void runColmap(const char* step, std::vector<std::string> arguments, const std::function<void()>& look);
  std::string threads() const;

  fs::path folder_;
  const PhotoList& list_;
  ReconstructionOptions options_;
  int64_t peakBytes_ = 0;
};

}  // namespace tessera

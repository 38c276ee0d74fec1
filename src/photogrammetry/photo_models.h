// Poses of photos from their matches: COLMAP's sparse models in the folder of PhotoMatches. Each step goes on where it
// was interrupted, and leaves models that others have not replaced.
//
//   sparse/N    the models of `map`
//   joined/     the largest of them, with those that share photos with it, and photos that were added later
//   adjusted/   the last of these, after the final bundle adjustment
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <set>
#include <vector>

#include "import/source.h"
#include "photogrammetry/colmap_program.h"
#include "photogrammetry/model_folders.h"
#include "photogrammetry/photo_list.h"
#include "photogrammetry/photo_pairs.h"

namespace tessera {

class PhotoModels {
 public:
  // `list` must outlive this object.
  PhotoModels(fs::path folder, const PhotoList& list, ColmapSettings settings);

  // Called twice a second; what it throws ends the program that runs.
  using Watch = std::function<void(int64_t photosInModel)>;

  // Estimates poses. `resumes`: keeps the models that an interrupted call has finished, and goes on from its last
  // snapshot of another. Throws Error if no model results.
  void map(bool resumes, const Watch& watch);

  void discardMapped() const;  // what an interrupted `map` would go on with

  // Joins models that share photos with the largest. Returns how many it has joined.
  int join(const Watch& watch);
  // Adds photos that further matches have connected with the largest model. `resumes` as for `map`.
  void extend(bool resumes, const Watch& watch);
  void discardJoined() const;

  // Adjusts poses, points and lenses together, then again without the observations that disagree with the result.
  // Cameras of many photos get a lens with decentring; if all cameras have many, also a free principal point, which the
  // mapper keeps in the middle: it would be too weakly determined while there are few photos.
  // Goes on after the adjustments that an interrupted call has finished, unless discardAdjusted() was called.
  void adjust(const Watch& watch);
  void discardAdjusted() const;

  struct Count {
    size_t models = 0;  // of `map`
    size_t photos = 0;  // of all these models together
  };
  Count countMapped() const;
  // Returns the photos that the last model lacks: indices into the list, sorted.
  std::vector<int> unplaced() const;
  // Of these, the photos of other models of `map`: sorted.
  std::vector<int> placedApart() const;
  // Returns the last model, with photos under their own names.
  SourceCapture read() const;

 private:
  static constexpr size_t kLeastShared = 3;  // photos of models that model_merger joins

  fs::path last(bool adjusted) const;
  // The result of an adjustment that follows so many others, without their outlying observations.
  fs::path adjustedOnce(int refits) const;
  void discardBegunAdjustments() const;
  // What the mapper begins with: a model that it goes on from, or a pair of photos.
  struct Beginning {
    fs::path model = {};
    std::optional<PhotoPair> pair = {};
  };
  // Adds models of the photos that are in none: once there is a model, the mapper begins no other unless a pair is very
  // well connected. Where matches link such a model with placed photos, it is continued with these, so that the models
  // can be joined. `withNeighbours`: all photos without a model are mapped with the placed ones that are linked with
  // them.
  void mapRest(const fs::path& models, bool withNeighbours, const Watch& watch);
  // If many photos have no model though matches link each with several that have one, the mapper began badly: adds
  // models of them all that begin with other pairs.
  void mapLinked(const fs::path& models, const Watch& watch);
  // Adds models of these photos alone, with limits that are less strict than those of `map`, and returns them.
  std::vector<Piece> mapOnly(const fs::path& models, const std::set<int>& photos, const Beginning& beginning,
                             const Watch& watch);
  std::vector<std::string> mapperArguments(const fs::path& output) const;  // those that all its runs share
  std::set<int> notIn(const std::vector<Piece>& pieces) const;             // the photos that none of these models has
  // Returns these photos, and those that are well matched with one of them.
  std::set<int> withMatched(std::set<int> photos) const;
  // Goes on from a snapshot if `resumes` and there is one, else from the model `input`, unless that is empty. `photos`:
  // all, if empty.
  void runMapper(const fs::path& input, const fs::path& output, const std::set<int>& photos, bool resumes,
                 const Watch& watch);
  // Writes a list of these photos for COLMAP, and returns its path.
  std::string writeNames(const char* file, const std::set<int>& photos) const;
  void runColmap(const char* step, std::vector<std::string> arguments, const std::function<void()>& look,
                 const std::function<bool()>& isDone = {});
  // Adjusts all poses, points and lenses of a model; the principal points only if `movesPrincipalPoint`. Throws Error
  // if COLMAP reports failure without a model.
  void adjustBundle(const char* step, const fs::path& input, const fs::path& output, bool movesPrincipalPoint,
                    const std::function<void()>& look);
  bool agreesWithGps(const fs::path& joined, const fs::path& before) const;
  SourceCapture readFrom(const fs::path& model) const;

  fs::path folder_;
  const PhotoList& list_;
  ColmapSettings settings_;
};

}  // namespace tessera

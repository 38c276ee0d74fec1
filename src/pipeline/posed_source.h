// Photos whose poses are known, of which `tessera run` leaves out the stages that find them.
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "import/source.h"
#include "photogrammetry/photo_list.h"
#include "pipeline/photo_run.h"

namespace tessera {

class PosedSource {
 public:
  // Returns nothing if `import` recognises no format with poses; a plain folder of photos is none. `options` must
  // outlive the result. Throws Error if the source cannot be read, or the rule of held-out photos does not fit it.
  static std::optional<PosedSource> open(const PhotoRunOptions& options);

  // Returns the source, once. In the folder `poses`, writes what the report says of poses: the photos that are left
  // out, and the georeference.
  SourceCapture take(const fs::path& poses);

  // A digest of poses, cameras, points and splits, and of the contents of photos, masks and depth maps (fileDigest).
  const std::string& digest() const { return digest_; }
  const std::vector<ListedPhoto>& photos() const { return photos_; }  // names and files alone
  // How large the capture is if its photos keep their size; where a photo cannot be read, its camera tells it.
  const TrainingSize& trainingSize() const { return size_; }
  bool holdsOut() const { return size_.heldOut > 0; }  // whether photos are held out, if none is dropped at import
  TrainingSize trainingSize(int downscale) const;      // in the folder of the run
  // Returns, until the source is taken, the photos that can be read, with Z up as import turns it if no tags tell more.
  // The observations still have the source's indices of photos.
  Capture capture() const;

 private:
  explicit PosedSource(const PhotoRunOptions& options);

  const PhotoRunOptions* options_;
  SourceCapture source_;
  std::string digest_;
  std::vector<ListedPhoto> photos_;
  std::vector<std::pair<int, int>> pictureSizes_;  // width and height, as on disk; 0: it cannot be read
  TrainingSize size_;
};

}  // namespace tessera

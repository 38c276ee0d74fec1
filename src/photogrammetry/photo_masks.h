// Masks that the user gives for photos: black where a photo is not to be used, for features and for training.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "base/file.h"
#include "base/threads.h"
#include "import/source.h"
#include "photogrammetry/photo_list.h"

namespace tessera {

class PhotoMasks {
 public:
  // `folder` holds the mask of a photo a/b.jpg as a/b.jpg.png, a/b.jpg or a/b.png. Throws Error if it is no folder.
  explicit PhotoMasks(fs::path folder);

  // Names and digests of all pictures in the folder, as text. Throws Error if it cannot be listed.
  std::string describe() const;

  // Set the masks of the photos that have one; of posed photos, in place of the source's own. A photo `images/a.jpg` of
  // a source may have its mask under the name `a.jpg`, too. Throw Error if no photo has a mask, or if one cannot be
  // read or has another size than its photo.
  void addTo(PhotoList& list) const;
  void addTo(SourceCapture& source) const;

 private:
  fs::path find(const std::string& name, const fs::path& photo) const;
  void report(size_t masks, const std::vector<std::string>& photos) const;

  fs::path folder_;
};

// Writes the masks of a list as COLMAP reads them, under the safe names of their photos: PNGs of one channel, 0 or 255.
// Those that are there stay. Returns whether there are any. `look` is called before each mask, by one thread at a time;
// what it throws ends this. Warns of masks that exclude whole photos. Throws Error if these are all photos, or if a
// mask cannot be decoded or written.
bool writeMasks(const PhotoList& list, const fs::path& folder, ThreadPool& pool,
                const std::function<void()>& look = {});

}  // namespace tessera

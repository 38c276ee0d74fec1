// Records the source of each image of a capture, so that an import that resumes reuses the images that are complete,
// and an import of another source reuses nothing of the previous one, whatever the names, sizes and times of its
// photos.
//
// The records are stored as sources.txt in the capture, one line per image: a hash of 16 hexadecimal digits over the
// path, size and time of its source and the conversion; two spaces; the image's path in the capture.
#pragma once

#include <map>
#include <string>

#include "base/file.h"

namespace tessera {

// Returns the path, size and time of a file.
std::string describeFile(const fs::path& file);

class PictureOrigins {
 public:
  // Adds an image. `picture` is its path in the capture; `how` describes everything else that its pixels depend on.
  void add(const std::string& picture, const fs::path& source, const std::string& how);

  // Throws Error if `capture`, which has no record of sources, holds a file in the place of an added image that is not
  // its source: a user's own, which `claim` would remove.
  void requireOwn(const fs::path& capture) const;

  // Removes those of the added images from `capture` that were produced from another source or conversion, then writes
  // sources.txt: every added image that exists afterwards can be reused. Throws Error if an image cannot be removed.
  void claim(const fs::path& capture) const;

 private:
  struct Origin {
    fs::path source;
    std::string fingerprint;
  };
  std::map<std::string, Origin> origins_;
};

}  // namespace tessera

// Names of image files for photos: below one folder, at the relative path of the photo, so that cam0/1.jpg and
// cam1/1.jpg become two files.
#pragma once

#include <set>
#include <string>

#include "base/file.h"

namespace tessera {

class PictureFiles {
 public:
  explicit PictureFiles(fs::path folder) : folder_(std::move(folder)) {}

  // Returns the photo's name without its extension, or the whole name if another photo already has that (a.jpg, then
  // a.png).
  std::string uniqueStem(const std::string& photo);
  // Returns the path of stem + ending. Throws Error if it lies outside of the folder.
  fs::path at(const std::string& stem, const std::string& ending) const;

 private:
  fs::path folder_;
  std::set<std::string> taken_;
};

}  // namespace tessera

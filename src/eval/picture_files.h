// Where the pictures of photos go: below one folder, each at its photo's own relative path, so that cam0/1.jpg and
// cam1/1.jpg are two pictures.
#pragma once

#include <set>
#include <string>

#include "base/file.h"

namespace tessera {

class PictureFiles {
 public:
  explicit PictureFiles(fs::path folder) : folder_(std::move(folder)) {}

  // The photo's name without its extension; the whole name where another photo has taken that (a.jpg, then a.png).
  std::string stemOf(const std::string& photo);
  // Throws Error when that lies outside of the folder.
  fs::path at(const std::string& stem, const std::string& ending) const;

 private:
  fs::path folder_;
  std::set<std::string> taken_;
};

}  // namespace tessera

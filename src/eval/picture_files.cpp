#include "eval/picture_files.h"

#include "base/error.h"

namespace tessera {

std::string PictureFiles::uniqueStem(const std::string& photo) {
  std::string stem = fs::path(photo).replace_extension().string();
  if (taken_.contains(stem)) stem = photo;
  while (taken_.contains(stem)) stem += "_";  // a.jpg, a.png and a.png.jpg
  taken_.insert(stem);
  return stem;
}

fs::path PictureFiles::at(const std::string& stem, const std::string& ending) const {
  const auto path = resolveInside(folder_, stem + ending);
  if (!path) throw Error(stem, "", "would be written outside of the folder", "rename the photo");
  return *path;
}

}  // namespace tessera

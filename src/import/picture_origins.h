// Remembers what each picture of a capture was made from, so that an import that goes on keeps what is ready, and one
// of another source keeps nothing of the last, whatever the names, sizes and times of its photos.
//
// On disk: sources.txt in the capture, a line for each picture: 16 hexadecimal digits over the path, size and time of
// its source and how it was converted; two blanks; the picture's path in the capture.
#pragma once

#include <map>
#include <string>

#include "base/file.h"

namespace tessera {

class PictureOrigins {
 public:
  // `picture`: path in the capture. `how`: whatever else its pixels depend on.
  void add(const std::string& picture, const fs::path& source, const std::string& how);

  // Removes those pictures from `capture` that were not made from what was added here, then writes sources.txt: every
  // picture that is there afterwards may be kept. Throws Error when a picture cannot be removed.
  void claim(const fs::path& capture) const;

 private:
  struct Origin {
    fs::path source;
    std::string fingerprint;
  };
  std::map<std::string, Origin> origins_;
};

}  // namespace tessera

// Small pictures of photos, for people to look at: turned upright, which the photos that are trained on never are.
#pragma once

#include <optional>

#include "base/file.h"
#include "base/image.h"

namespace tessera {

// Returns the picture as viewers show it. `orientation`: of EXIF, 1 to 8; others mean 1.
ImageU8 turnUpright(const ImageU8& image, int orientation);

struct Thumbnail {
  int width = 0, height = 0;
  Bytes jpeg;
};

// Returns a photo, upright, with a longest side of at most `longestSide` pixels. Returns nothing if it cannot be read.
std::optional<Thumbnail> makeThumbnail(const fs::path& photo, int orientation, int longestSide);

}  // namespace tessera

// Small pictures of photos, for people to look at: turned upright, which the photos that are trained on never are.
#pragma once

#include <optional>

#include "base/file.h"
#include "base/image.h"

namespace tessera {

struct Thumbnail {
  int width = 0, height = 0;
  Bytes jpeg;
};

// Returns a photo, upright, with a longest side of at most `longestSide` pixels. Returns nothing if it cannot be read.
std::optional<Thumbnail> makeThumbnail(const fs::path& photo, int orientation, int longestSide);

}  // namespace tessera

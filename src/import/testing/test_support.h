// Shared by the tests of src/import: small images, and the location of real data.
#pragma once

#include <cstdlib>
#include <optional>
#include <string>

#include "base/image_io.h"
#include "base/testing/temporary_folder.h"

namespace tessera {

// Returns an image without two equal neighbouring pixels.
inline ImageU8 gradientPicture(int width, int height, int channels = 3, int seed = 0) {
  ImageU8 image(width, height, channels);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      for (int c = 0; c < channels; ++c) image.at(x, y)[c] = static_cast<uint8_t>(x * 7 + y * 13 + c * 50 + seed);
      if (channels == 4) image.at(x, y)[3] = 255;
    }
  }
  return image;
}

// Returns the folder `name` in TESSERA_SHARED_DATA, or nothing if it does not exist.
inline std::optional<fs::path> sharedData(const std::string& name) {
  const char* root = std::getenv("TESSERA_SHARED_DATA");
  if (root == nullptr || !fs::is_directory(fs::path(root) / name)) return std::nullopt;
  return fs::path(root) / name;
}

}  // namespace tessera

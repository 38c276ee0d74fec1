// Shared by the tests of src/import: small images.
#pragma once

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

}  // namespace tessera

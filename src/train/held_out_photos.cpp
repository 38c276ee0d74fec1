#include "train/held_out_photos.h"

#include <algorithm>

#include "base/check.h"

namespace tessera {

HeldOutPhotos holdOutPhotos(const Capture& capture, uint32_t every, uint64_t seed) {
  CHECK(every >= 2u);
  const std::vector<int> photos = capture.photosIn(Split::train);
  CHECK(photos.size() >= 2u);
  const size_t step = std::min<size_t>(every, photos.size());
  HeldOutPhotos result{std::vector<TileShares>(capture.photos.size()), std::vector<TileShares>(capture.photos.size())};
  for (size_t i = 0; i < photos.size(); ++i) {
    const size_t photo = static_cast<size_t>(photos[i]);
    const Camera& camera = capture.cameras[static_cast<size_t>(capture.photos[photo].camera)];
    const PhotoTile whole{photos[i], 0, 0, static_cast<uint32_t>(camera.width), static_cast<uint32_t>(camera.height)};
    const double pixels = static_cast<double>(camera.width) * camera.height;
    (i % step == seed % step ? result.heldOut : result.trained)[photo] = {{whole}, {pixels}};
  }
  return result;
}

}  // namespace tessera

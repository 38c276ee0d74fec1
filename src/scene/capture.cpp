#include "scene/capture.h"

namespace tessera {

std::vector<int> Capture::photosIn(Split split) const {
  std::vector<int> indices;
  for (size_t i = 0; i < photos.size(); ++i) {
    if (photos[i].split == split) indices.push_back(static_cast<int>(i));
  }
  return indices;
}

}  // namespace tessera

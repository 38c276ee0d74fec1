// How a model becomes a scene, whatever its representation.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <optional>

namespace tessera {

struct BakeOptions {
  // What training photos see is kept: samples of their pixels whose weight in the picture and whose opacity over a
  // renderer's step are both above these (MERF's). Bakers of models that were trained with a last threshold of the
  // opacity take that one.
  double minWeight = 0.005, minAlpha = 0.005;
  // Of the scene, where no photo looked. Without: what the baker says, as a hazy sky.
  std::optional<std::array<float, 3>> background;
  int stride = 1;  // every so manieth pixel along rows and columns; where levels have models, twice as much each
  int effort = 4;  // of compression, 0 to 9
  // `all` counts the photos of all models that look at them. Of a model that holds few blocks at a time, photos are
  // done in parts.
  std::function<void(int64_t done, int64_t all)> onPhoto = [](int64_t, int64_t) {};
};

}  // namespace tessera

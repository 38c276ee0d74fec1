// Options of baking a model into a scene, for all representations.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>

#include "scene/exposure_response.h"

namespace tessera {

struct BakeOptions {
  std::string name;  // of the scene, for people; empty: that of the capture's folder
  // Baking keeps the samples along the rays of training photos whose weight in the image and whose opacity over a
  // renderer's step both exceed these thresholds (MERF). Bakers of models that were trained with a final opacity
  // threshold use that one.
  double minWeight = 0.005, minAlpha = 0.005;
  // The scene's background, for directions that no photo shows. Without it, the baker's default is used, for example a
  // hazy sky.
  std::optional<std::array<float, 3>> background;
  // Every stride-th pixel along rows and columns is used; doubled at each coarser level that has a model of its own.
  int stride = 1;
  int effort = 4;  // compression effort, 0 to 9
  // How colours follow the exposure of a photo, which the scene states.
  std::optional<ExposureResponse> exposureResponse;
  // Reports progress in steps: a step is a photo that has been processed with one model, or a part that has been baked
  // without photos. For a model that holds only few blocks at a time, photos are processed in parts.
  std::function<void(int64_t done, int64_t all)> onStep = [](int64_t, int64_t) {};
};

}  // namespace tessera

// For tests: captures of plain images.
#pragma once

#include <string>

#include "base/image_io.h"
#include "base/testing/temporary_folder.h"
#include "scene/capture.h"

namespace tessera {

// Writes `count` photos of 16×12 pixels to `folder`, each of a uniform grey (8 × its index).
inline Capture plainCapture(const fs::path& folder, int count) {
  Capture capture;
  capture.root = folder;
  Camera camera;
  camera.width = 16;
  camera.height = 12;
  camera.parameters = {20, 20, 8, 6};
  capture.cameras.push_back(camera);
  for (int i = 0; i < count; ++i) {
    Photo photo;
    photo.name = "photo_" + std::to_string(i) + ".png";
    photo.image = folder / photo.name;
    photo.worldFromCamera.translation.x() = i;
    writePng(photo.image, ImageU8(16, 12, 3, static_cast<uint8_t>(8 * i)));
    capture.photos.push_back(photo);
  }
  return capture;
}

inline constexpr size_t kPlainPhotoBytes = 16 * 12 * 3;

}  // namespace tessera

// What the tests of this room share: a folder that goes away, and captures of plain pictures.
#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <string>

#include "base/file.h"
#include "base/image_io.h"
#include "scene/capture.h"

namespace tessera {

class TestFolder {
 public:
  TestFolder() {
    const auto* test = testing::UnitTest::GetInstance()->current_test_info();
    path_ = fs::weakly_canonical(fs::temp_directory_path()) /
            ("tessera-" + std::string(test->test_suite_name()) + "-" + test->name() + "-" + std::to_string(::getpid()));
    fs::remove_all(path_);
    fs::create_directories(path_);
  }
  ~TestFolder() {
    std::error_code ignored;
    fs::remove_all(path_, ignored);
  }
  const fs::path& path() const { return path_; }
  fs::path operator/(const std::string& name) const { return path_ / name; }

 private:
  fs::path path_;
};

// `count` photos of 16×12 pixels, each of one grey (8 × its index), in `folder`.
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

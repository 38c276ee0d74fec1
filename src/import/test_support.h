// What the tests of this room share: a folder that goes away, and small pictures.
#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdlib>
#include <optional>
#include <string>

#include "base/file.h"
#include "base/image_io.h"

namespace tessera {

class TemporaryFolder {
 public:
  TemporaryFolder() {
    const auto* test = testing::UnitTest::GetInstance()->current_test_info();
    std::string name =
        std::string("tessera-") + test->test_suite_name() + "-" + test->name() + "-" + std::to_string(::getpid());
    for (char& c : name) c = c == '/' ? '_' : c;
    path_ = fs::weakly_canonical(fs::temp_directory_path()) / name;
    fs::remove_all(path_);
    fs::create_directories(path_);
  }
  ~TemporaryFolder() {
    std::error_code ignored;
    fs::remove_all(path_, ignored);
  }
  const fs::path& path() const { return path_; }
  fs::path operator/(const std::string& name) const { return path_ / name; }

 private:
  fs::path path_;
};

// A picture without two equal pixels in a row.
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

inline std::optional<fs::path> sharedData(const std::string& name) {
  const char* root = std::getenv("TESSERA_SHARED_DATA");
  if (root == nullptr || !fs::is_directory(fs::path(root) / name)) return std::nullopt;
  return fs::path(root) / name;
}

}  // namespace tessera

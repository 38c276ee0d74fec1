#include "import/clean.h"

#include <gtest/gtest.h>

#include "base/error.h"
#include "base/image_io.h"
#include "base/testing/temporary_folder.h"

namespace tessera {
namespace {

// As from a network drive that is away for a while: a capture without that photo would silently be another one.
TEST(CleanSource, ThrowsIfADiskFailsToReadAPhoto) {
  const TemporaryFolder folder;
  writePng(folder / "a.png", ImageU8(8, 6, 3));
  const auto clean = [&](const fs::path& second) {
    SourceCapture source;
    source.capture.cameras = {{8, 6, LensModel::pinhole, {7, 7, 4, 3}}};
    for (const fs::path& image : {folder / "a.png", second}) {
      Photo photo;
      photo.name = image.filename().string();
      photo.image = image;
      source.capture.photos.push_back(photo);
    }
    ThreadPool pool(1);
    cleanSource(source, pool);
    return source.capture.photos.size();
  };
  EXPECT_EQ(clean(folder / "absent.png"), 1u);
  EXPECT_THROW(clean("/proc/self/mem"), Error) << "a file that is there, but cannot be read";
}

}  // namespace
}  // namespace tessera

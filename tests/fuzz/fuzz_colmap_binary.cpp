// Fuzzes bytes → COLMAP model → capture: poses, lenses and reprojection of whatever numbers were accepted.
#include "fuzz_input.h"
#include "import/colmap_model.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  tessera::FuzzInput input(data, size);
  const auto cameras = input.file(), images = input.file();
  std::string reason;
  const auto model = tessera::decodeColmapBinary(cameras, images, input.rest(), reason);
  if (model) tessera::captureFromColmap(*model, "/nonexistent");
  return 0;
}

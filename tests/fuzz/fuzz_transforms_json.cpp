#include "fuzz_input.h"
#include "import/transforms_json.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  std::string reason;
  const tessera::FuzzInput input(data, size);
  const auto file = tessera::decodeTransforms(input.asText(input.rest()), reason);
  if (!file) return 0;
  for (const auto& frame : file->frames) {
    const auto camera = tessera::cameraFromIntrinsics(frame.intrinsics, 640, 480, reason);
    if (!camera) continue;
    if (const auto direction = camera->directionInCamera({3, 5})) camera->pixelFromCamera(*direction);
    camera->scaledTo(100, 77);
  }
  return 0;
}

#include "fuzz_input.h"
#include "import/colmap_model.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  tessera::FuzzInput input(data, size);
  const auto cameras = input.text(), images = input.text();
  std::string reason;
  const auto model = tessera::decodeColmapText(cameras, images, input.asText(input.rest()), reason);
  if (model) tessera::captureFromColmap(*model, "/nonexistent");
  return 0;
}

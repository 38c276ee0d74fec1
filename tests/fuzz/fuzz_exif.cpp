#include "fuzz_input.h"
#include "import/exif.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const tessera::FuzzInput input(data, size);
  tessera::decodePhotoTags(input.rest());
  tessera::decodeXmp(input.asText(input.rest()));
  return 0;
}

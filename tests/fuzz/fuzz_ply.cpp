#include "fuzz_input.h"
#include "scene/ply.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const auto points = tessera::decodePly(tessera::FuzzInput(data, size).rest());
  // What was decoded can be encoded and decoded again.
  if (points && tessera::decodePly(tessera::encodePly(*points))->size() != points->size()) __builtin_trap();
  return 0;
}

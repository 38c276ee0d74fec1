// Decodes dataparser_transforms.json from arbitrary text: an accepted transform is finite and invertible.
#include <Eigen/LU>
#include <cstdlib>

#include "scene/camera_path.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const auto dataparserFromSource = tessera::decodeDataparserTransforms({reinterpret_cast<const char*>(data), size});
  if (!dataparserFromSource) return 0;
  if (!dataparserFromSource->allFinite() || !dataparserFromSource->inverse().allFinite()) std::abort();
  return 0;
}

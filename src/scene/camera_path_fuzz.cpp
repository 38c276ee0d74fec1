// Decodes camera paths from arbitrary text: an accepted path has finite poses and lenses, and can be written and read
// back.
#include <cmath>
#include <cstdlib>

#include "scene/camera_path.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const auto path = tessera::decodeCameraPath({reinterpret_cast<const char*>(data), size});
  if (!path) return 0;
  for (const tessera::CameraPathView& view : path->views) {
    if (!view.worldFromCamera.rotation.allFinite() || !view.worldFromCamera.translation.allFinite()) std::abort();
    if (!(path->makeViewCamera(view).focalX() > 0)) std::abort();
  }
  if (!tessera::decodeCameraPath(tessera::encodeCameraPath(*path))) std::abort();
  return 0;
}

#include "import/capture_reader.h"

#include "base/error.h"
#include "import/transforms_json.h"

namespace tessera {

Capture readCapture(const fs::path& folder) {
  std::error_code status;
  const fs::path file = folder / "transforms.json";
  if (!fs::is_regular_file(file, status)) {
    throw Error(folder.string(), "", "is not a capture (it has no transforms.json)",
                "make one with: tessera import " + folder.string() + " CAPTURE");
  }
  SourceCapture source = readTransforms({file});
  if (!source.isOurs) {
    throw Error(file.string(), "", "was not written by tessera",
                "import it first: tessera import " + folder.string() + " CAPTURE");
  }
  if (source.splitError) throw *source.splitError;
  Capture& capture = source.capture;
  capture.root = folder;
  if (capture.photos.empty()) throw Error(file.string(), "frames", "has no photos", "import the photos again");
  for (const Photo& photo : capture.photos) {
    if (photo.camera >= static_cast<int>(capture.cameras.size())) {
      throw Error(file.string(), photo.name, "has no camera", "import the photos again");
    }
    for (const fs::path* picture : {&photo.image, &photo.mask, &photo.depth}) {
      if (!picture->empty() && !fs::is_regular_file(*picture, status)) {
        throw Error(picture->string(), "", "is missing from the capture", "import the photos again");
      }
    }
  }
  return std::move(capture);
}

bool isCapture(const fs::path& folder) {
  const fs::path file = folder / "transforms.json";
  std::error_code status;
  return fs::is_regular_file(file, status) && loadTransforms(file).isOurs;
}

}  // namespace tessera

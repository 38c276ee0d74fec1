// mesh_transients MODEL CAPTURE MASKED [STATIC]: how well the masks of what moves, which the training of a mesh makes
// with `transient=auto`, match those of a synthetic city. CAPTURE: what MODEL's coarse field was trained on, without
// masks; MASKED: the same with them. STATIC: the same photos without traffic: tells which share of what the cars
// change, in squared differences of colours, the masks exclude. Prints JSON. See mesh.sh.
#include <cstdio>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/image_io.h"
#include "compute/device.h"
#include "import/capture_reader.h"
#include "representations/mesh/train/trained_mesh.h"
#include "representations/mesh/train/transient_masks.h"
#include "train/photo_visibility.h"

namespace tessera {
namespace {

// Sums over the pixels of all training photos.
struct Sums {
  double pixels = 0, excluded = 0, moving = 0, hit = 0;
  double far = 0;  // excluded, with no true mask within kNear pixels
  double changes = 0, excludedChanges = 0;
};
constexpr int kNear = 3;

bool isMovingNear(const ImageU8& mask, int x, int y) {
  for (int v = std::max(0, y - kNear); v <= std::min(mask.height - 1, y + kNear); ++v)
    for (int u = std::max(0, x - kNear); u <= std::min(mask.width - 1, x + kNear); ++u)
      if (*mask.at(u, v) < 128) return true;
  return false;
}

void addPhoto(const ImageU8& mask, const ImageU8& truth, const ImageU8& photo, const ImageU8& still, Sums& sums) {
  constexpr double kNoise = 0.003;  // of equal pixels, after JPEG
  for (int y = 0; y < truth.height; ++y) {
    for (int x = 0; x < truth.width; ++x) {
      const bool isExcluded = *mask.at(x * mask.width / truth.width, y * mask.height / truth.height) == 0;
      const bool isMoving = *truth.at(x, y) < 128;
      ++sums.pixels;
      sums.excluded += isExcluded ? 1 : 0;
      sums.moving += isMoving ? 1 : 0;
      sums.hit += isExcluded && isMoving ? 1 : 0;
      sums.far += isExcluded && !isMovingNear(truth, x, y) ? 1 : 0;
      if (still.empty()) continue;
      double change = 0;
      for (int k = 0; k < 3; ++k) {
        const double difference = (photo.at(x, y)[k] - still.at(x, y)[k]) / 255.0;
        change += difference * difference;
      }
      if (change < kNoise) continue;
      sums.changes += change;
      sums.excludedChanges += isExcluded ? change : 0;
    }
  }
}

nlohmann::ordered_json compareMasks(const fs::path& model, const Capture& capture, const Capture& masked,
                                    const Capture* still) {
  const std::unique_ptr<Device> device = makeDevice({});
  ComparedPhotos compared = comparePhotos(capture, *loadFieldModel(*device, coarseFolder(model).root()));
  const TransientSettings settings = chooseTransientSettings(compared);
  const std::vector<ImageU8> masks = findTransientPixels(std::move(compared.photos), settings);
  Sums sums;
  size_t next = 0;
  for (const int number : capture.photosIn(Split::train)) {
    const Photo& truth = masked.photos[static_cast<size_t>(number)];
    const ImageU8 stillPhoto = still ? readImage(still->photos[static_cast<size_t>(number)].image).image : ImageU8();
    addPhoto(masks[next++], readPhotoMask(truth, masked.cameras[truth.camera]), readImage(truth.image).image,
             stillPhoto, sums);
  }
  nlohmann::ordered_json result = {{"excluded_share", sums.excluded / sums.pixels},
                                   {"moving_share", sums.moving / sums.pixels},
                                   {"precision", sums.hit / sums.excluded},
                                   {"recall", sums.hit / sums.moving},
                                   {"share_excluded_elsewhere", sums.far / sums.pixels}};
  if (still) result["excluded_changes"] = sums.excludedChanges / sums.changes;
  return result;
}

}  // namespace
}  // namespace tessera

int main(int argc, char** argv) {
  using namespace tessera;
  if (argc < 4) {
    std::fprintf(stderr, "usage: mesh_transients MODEL CAPTURE MASKED [STATIC]\n");
    return 2;
  }
  try {
    const Capture capture = readCapture(argv[2]), masked = readCapture(argv[3]);
    const Capture still = argc > 4 ? readCapture(argv[4]) : Capture();
    std::printf("%s\n", compareMasks(argv[1], capture, masked, argc > 4 ? &still : nullptr).dump(2).c_str());
    return 0;
  } catch (const Error& error) {
    std::fprintf(stderr, "mesh_transients: error: %s\n", error.what());
    return 1;
  }
}

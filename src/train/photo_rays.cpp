#include "train/photo_rays.h"

#include <cmath>
#include <limits>

#include "base/error.h"
#include "train/visible_cells.h"

namespace tessera {
namespace {

constexpr float kGoldenRatio = 0.61803399f;

std::vector<RayCamera> rayCameras(const Capture& capture, const SceneFrame& frame) {
  std::vector<RayCamera> cameras;
  for (const Photo& photo : capture.photos) {
    cameras.push_back(makeRayCamera(capture.cameras[photo.camera], photo.worldFromCamera, frame));
  }
  return cameras;
}

std::vector<int> trainingPhotos(const Capture& capture) {
  std::vector<int> photos = capture.photosIn(Split::train);
  if (photos.empty()) {
    throw Error(capture.root.string(), "transforms.json", "no photo is marked for training",
                "import again with another --holdout");
  }
  return photos;
}

}  // namespace

PhotoRays::PhotoRays(Device& device, const Capture& capture, const SceneFrame& frame, const Settings& settings)
    : device_(device),
      settings_(settings),
      pool_(device.hostThreads()),
      photos_(capture, settings.photos.empty() ? trainingPhotos(capture) : settings.photos,
              {static_cast<size_t>(settings.photoBudgetMiB * 1048576), settings.stepsPerPhoto, settings.seed}),
      known_(findSparseDepths(capture, frame, kMaxReprojectionError)),
      cameras_(device.uploadArray(rayCameras(capture, frame))),
      photoOfRay_(device.array<uint32_t>(settings.maxRays)) {
  const size_t rays = settings.maxRays;
  for (Array<float>* one : {&weights_, &opaqueWeights_, &distances_, &nears_, &fars_}) *one = device.array<float>(rays);
  if (settings.nearFromSparseDepth) {
    for (const double depth : nearestSparseDepth(capture)) {
      nearOfPhoto_.push_back(static_cast<float>(kNearShare * depth * frame.scale));
    }
  }
  jitter_ = device.array<float>(rays * settings.jitters);
  pixels_ = device.array<float>(2 * rays);
  for (Array<float>* three : {&targets_, &backgrounds_, &origins_, &directions_})
    *three = device.array<float>(3 * rays);
}

void PhotoRays::draw(int64_t step, uint32_t rays, uint32_t square) {
  CHECK(rays <= settings_.maxRays);
  drawRays(photos_.at(step), known_,
           {settings_.seed, settings_.randomBackground, settings_.sparseDepthRayFraction, tiles_ ? &*tiles_ : nullptr,
            square},
           step, rays, pool_, batch_);
  count_ = rays;
  device_.write(photoOfRay_.all(), std::span<const uint32_t>(batch_.photoOfRay));
  device_.write(pixels_.all(), std::span<const float>(batch_.pixels));
  device_.write(targets_.all(), std::span<const float>(batch_.targets));
  device_.write(backgrounds_.all(), std::span<const float>(batch_.backgrounds));
  device_.write(weights_.all(), std::span<const float>(batch_.weights));
  device_.write(opaqueWeights_.all(), std::span<const float>(batch_.opaqueWeights));
  device_.write(distances_.all(), std::span<const float>(batch_.distances));
  limitRays();
  std::vector<float> jitter;
  for (uint32_t k = 0; k < settings_.jitters; ++k) {
    for (const float first : batch_.jitter) {
      const float turned = first + kGoldenRatio * static_cast<float>(k);
      jitter.push_back(turned - std::floor(turned));
    }
  }
  device_.write(jitter_.all(), std::span<const float>(jitter));
  device_.run(GenerateRays{{rays, {}}, cameras_, photoOfRay_, pixels_, origins_, directions_});
}

void PhotoRays::limitRays() {
  std::vector<float> nears(count_), fars(count_, std::numeric_limits<float>::infinity());
  const float margin = static_cast<float>(settings_.sparseDepthMargin);
  for (uint32_t ray = 0; ray < count_; ++ray) {
    if (settings_.nearFromSparseDepth) nears[ray] = nearOfPhoto_[batch_.photoOfRay[ray]];
    const float known = batch_.distances[ray];
    if (known == 0 || margin == 0) continue;
    nears[ray] = (1 - margin) * known;
    fars[ray] = (1 + margin) * known;
  }
  device_.write(nears_.all(), std::span<const float>(nears));
  device_.write(fars_.all(), std::span<const float>(fars));
}

}  // namespace tessera

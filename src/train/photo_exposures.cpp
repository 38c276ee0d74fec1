#include "train/photo_exposures.h"

namespace tessera {

PhotoExposures::PhotoExposures(Device& device, const Capture& capture)
    : device_(device),
      trainingPhotos_(capture.photosIn(Split::train)),
      group_(device, "exposures", std::vector<float>(capture.photos.size() * 3)) {}

void PhotoExposures::step(const Adam& adam, bool train) {
  if (train) {
    group_.step(device_, adam);
  } else {
    device_.fillZero(group_.gradients.all());
  }
}

void PhotoExposures::settle(int64_t step, bool train) {
  if (train && step % 16 == 15) centre();
}

void PhotoExposures::restoreFirst(const fs::path& path, const Safetensors& file, size_t photos) {
  ParameterGroup first(device_, group_.name, std::vector<float>(3 * photos), false);
  loadGroup(device_, path, file, first);
  const std::vector<float> gains = device_.read(first.values.all());
  device_.write(group_.values.part(0, gains.size()), std::span<const float>(gains));
}

void PhotoExposures::centre() {
  std::vector<float> gains = device_.read(group_.values.all());
  for (int channel = 0; channel < 3; ++channel) {
    double mean = 0;
    for (const int photo : trainingPhotos_) mean += gains[3 * photo + channel];
    mean /= static_cast<double>(trainingPhotos_.size());
    for (const int photo : trainingPhotos_) gains[3 * photo + channel] -= static_cast<float>(mean);
  }
  device_.write(group_.values.all(), std::span<const float>(gains));
}

}  // namespace tessera

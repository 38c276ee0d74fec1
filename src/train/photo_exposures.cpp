#include "train/photo_exposures.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "base/log.h"

namespace tessera {
namespace {

constexpr float kMaxLogGain = 3;  // a black photo would pull its own without end, and with the mean those of the others
constexpr const char* kResponse = "exposure_response";  // slopes, then offsets: 6 numbers

std::optional<ExposureResponse> responseIn(const fs::path& path, const Safetensors& checkpoint) {
  if (!checkpoint.tensors.contains(kResponse)) return std::nullopt;
  const auto values = checkpoint.require(path, kResponse, TensorType::f32).as<float>();
  if (values.size() != 6 || !std::all_of(values.begin(), values.end(), [](float x) { return std::isfinite(x); }))
    throw Error(path.string(), std::string("tensor ") + kResponse, "does not have six finite numbers", "train again");
  ExposureResponse response;
  std::copy_n(values.begin(), 3, response.slope.begin());
  std::copy_n(values.begin() + 3, 3, response.offset.begin());
  return response;
}

// `isPart`: of a model that consists of models, which do not consist of others.
std::optional<ExposureResponse> readResponse(const ModelFolder& model, bool isPart) {
  const auto manifest = model.manifest();
  if (!manifest) return std::nullopt;
  for (const std::string& name : manifest->files) {
    const fs::path file = model.root() / name;
    if (file.extension() == ".json") {  // of a model that consists of models
      if (isPart) continue;
      try {
        if (const auto response = readResponse(ModelFolder(file.parent_path()), true)) return response;
      } catch (const Error& error) {
        warn("how colours follow exposures is not known: {}", error.what());
      }
      continue;
    }
    // The first part that trains exposures tells; the others need not be read.
    const Safetensors checkpoint = readSafetensors(file);
    if (checkpoint.tensors.contains("exposures")) return responseIn(file, checkpoint);
  }
  return std::nullopt;
}

}  // namespace

std::optional<ExposureResponse> readExposureResponse(const ModelFolder& model) {
  return readResponse(model, false);
}

PhotoExposures::PhotoExposures(Device& device, const Capture& capture)
    : device_(device),
      trainingPhotos_(capture.photosIn(Split::train)),
      group_(device, "exposures", std::vector<float>(capture.photos.size() * 3)) {
  for (const Photo& photo : capture.photos) exposures_.push_back(photo.exposure);
}

void PhotoExposures::save(TensorSet& tensors) {
  tensors.add(device_, group_, true);
  const std::vector<float> gains = device_.read(group_.values.all());
  const auto response = fitExposureResponse(exposures_, trainedPhotos(), gains);
  if (!response) return;
  std::vector<float> values(response->slope.begin(), response->slope.end());
  values.insert(values.end(), response->offset.begin(), response->offset.end());
  tensors.add(kResponse, values);
}

void PhotoExposures::restore(const fs::path& path, const Safetensors& file) {
  if (!isHeld_) loadGroup(device_, path, file, group_);
}

void PhotoExposures::step(Adam adam, bool train) {
  if (train && !isHeld_) {
    adam.bound = kMaxLogGain;
    group_.step(device_, adam);
  } else {
    device_.fillZero(group_.gradients.all());
  }
}

void PhotoExposures::settle(int64_t step, bool train) {
  if (train && !isHeld_ && step % 16 == 15) centre();
}

void PhotoExposures::hold(const ModelFolder& model) {
  const auto manifest = model.manifest();
  for (const std::string& name : manifest ? manifest->files : std::vector<std::string>()) {
    const fs::path file = model.root() / name;
    const Safetensors checkpoint = readSafetensors(file);
    if (!checkpoint.tensors.contains(group_.name)) continue;
    restore(file, checkpoint);
    isHeld_ = true;
    return;
  }
  throw Error(model.root().string(), "", "has no exposures of photos", "train it again");
}

std::vector<int> PhotoExposures::trainedPhotos() {
  const std::vector<uint32_t> counts = device_.read(group_.counts.all());
  std::vector<int> photos;
  for (const int photo : trainingPhotos_) {
    const auto ofPhoto = counts.begin() + 3 * std::ptrdiff_t{photo};
    if (std::any_of(ofPhoto, ofPhoto + 3, [](uint32_t count) { return count > 0; })) photos.push_back(photo);
  }
  return photos;
}

void PhotoExposures::restoreFirst(const fs::path& path, const Safetensors& file, size_t photos) {
  ParameterGroup first(device_, group_.name, std::vector<float>(3 * photos), false);
  loadGroup(device_, path, file, first);
  const std::vector<float> gains = device_.read(first.values.all());
  device_.write(group_.values.part(0, gains.size()), std::span<const float>(gains));
}

void PhotoExposures::centre() {
  const std::vector<int> photos = trainedPhotos();
  if (photos.empty()) return;
  std::vector<float> gains = device_.read(group_.values.all());
  for (int channel = 0; channel < 3; ++channel) {
    double mean = 0;
    for (const int photo : photos) mean += gains[3 * photo + channel];
    mean /= static_cast<double>(photos.size());
    for (const int photo : photos) gains[3 * photo + channel] -= static_cast<float>(mean);
  }
  device_.write(group_.values.all(), std::span<const float>(gains));
}

}  // namespace tessera

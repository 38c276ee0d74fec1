// A trainable exposure for each photo: a log2 gain per colour channel. Only differences between photos can be
// determined, so their mean over the training photos is kept at zero, which is the exposure that evaluation uses.
#pragma once

#include "field/parameters.h"
#include "scene/capture.h"
#include "scene/exposure_response.h"
#include "train/model_folder.h"

namespace tessera {

// Returns the response that a model's checkpoint contains; nothing if there is none. Throws Error if a file cannot be
// read or is malformed.
std::optional<ExposureResponse> readExposureResponse(const ModelFolder& model);

class PhotoExposures {
 public:
  PhotoExposures(Device& device, const Capture& capture);

  Slice<const float> logGains() const { return group_.values; }  // [photos][3]
  Slice<float> gradients() { return group_.gradients; }
  // Performs one step of Adam; without `train` only clears the gradients.
  void step(const Adam& adam, bool train);
  // Call it after each step: calls centre() every 16th step if `train` is set, which waits for the device.
  void settle(int64_t step, bool train);
  // Restricts the mean to these photos; the exposures of the others stay at zero.
  void trainOn(std::vector<int> photos) { trainingPhotos_ = std::move(photos); }
  // Subtracts the mean. Waits for the device.
  void centre();

  bool allFinite() const { return group_.allFinite(device_); }
  // Saves also the response to the exposures that the photos' EXIF states, if they explain the gains.
  void save(TensorSet& tensors);
  void restore(const fs::path& path, const Safetensors& file) { loadGroup(device_, path, file, group_); }
  // Restores the exposures of the first `photos` from a training on these alone; the others stay as they are.
  void restoreFirst(const fs::path& path, const Safetensors& file, size_t photos);

 private:
  Device& device_;
  std::vector<double> exposures_;  // by EXIF, of each photo
  std::vector<int> trainingPhotos_;
  ParameterGroup group_;
};

}  // namespace tessera

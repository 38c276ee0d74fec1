// A trainable exposure for each photo: a log2 gain per colour channel, at most three stops. Only differences between
// photos can be determined, so their mean over the photos that were trained on is kept at zero, which is the exposure
// that evaluation uses.
#pragma once

#include <optional>
#include <vector>

#include "field/parameters.h"
#include "scene/capture.h"
#include "scene/exposure_response.h"
#include "train/model_folder.h"

namespace tessera {

// Returns the response that a model's checkpoint contains; nothing if there is none. Throws Error if a file cannot be
// read or is malformed; of a model in the model, which may be all that it is read for, it only warns.
std::optional<ExposureResponse> readExposureResponse(const ModelFolder& model);

class PhotoExposures {
 public:
  PhotoExposures(Device& device, const Capture& capture);

  Slice<const float> logGains() const { return group_.values; }  // [photos][3]
  Slice<float> gradients() { return group_.gradients; }
  // Performs one step of Adam; without `train`, or after hold(), only clears the gradients.
  void step(Adam adam, bool train);
  // Call it after each step: calls centre() every 16th step if `train` is set, which waits for the device.
  void settle(int64_t step, bool train);
  // Takes the exposures of a model of the same photos, such as the finest level of detail, and no longer trains them:
  // levels that fit their own would differ in brightness. Throws Error if the model has none, or a file cannot be read.
  void hold(const ModelFolder& model);
  // Restricts the mean to these photos; the exposures of the others stay at zero.
  void trainOn(std::vector<int> photos) { trainingPhotos_ = std::move(photos); }
  // Subtracts the mean of the photos of which rays were drawn. Waits for the device.
  void centre();

  bool allFinite() const { return group_.allFinite(device_); }
  // Saves also the response to the exposures that the photos' EXIF states, if they explain the gains.
  void save(TensorSet& tensors);
  // Does nothing after hold(): levels of former versions have exposures of their own.
  void restore(const fs::path& path, const Safetensors& file);
  // Restores the exposures of the first `photos` from a training on these alone; the others stay as they are.
  void restoreFirst(const fs::path& path, const Safetensors& file, size_t photos);

 private:
  std::vector<int> trainedPhotos();  // of the training photos those of which rays were drawn

  Device& device_;
  std::vector<std::optional<double>> exposures_;  // by EXIF, of each photo
  std::vector<int> trainingPhotos_;
  ParameterGroup group_;
  bool isHeld_ = false;
};

}  // namespace tessera

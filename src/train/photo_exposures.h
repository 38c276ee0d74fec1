// An exposure for each photo, trained along: a gain per colour channel (log2). Only differences between photos can be
// told, so their mean over the training photos is held at zero, which is what evaluation uses.
#pragma once

#include "field/parameters.h"
#include "scene/capture.h"

namespace tessera {

class PhotoExposures {
 public:
  PhotoExposures(Device& device, const Capture& capture);

  Slice<const float> logGains() const { return group_.values; }  // [photos][3]
  Slice<float> gradients() { return group_.gradients; }
  // One step of Adam; without `train` gradients are dropped.
  void step(const Adam& adam, bool train);
  // After a step that has been made: every now and then, centres. Waits.
  void settle(int64_t step, bool train);
  // Only these photos are trained on: the others' stay where the mean is.
  void trainOn(std::vector<int> photos) { trainingPhotos_ = std::move(photos); }
  // Puts the mean at zero. Waits.
  void centre();

  bool allFinite() const { return group_.allFinite(device_); }
  void save(TensorSet& tensors) { tensors.add(device_, group_, true); }
  void restore(const fs::path& path, const Safetensors& file) { loadGroup(device_, path, file, group_); }

 private:
  Device& device_;
  std::vector<int> trainingPhotos_;
  ParameterGroup group_;
};

}  // namespace tessera

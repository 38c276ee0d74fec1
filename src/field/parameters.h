// Trainable parameters on a device with the state of Adam, and their representation in a safetensors file.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "base/safetensors.h"
#include "compute/adam.h"
#include "compute/device.h"

namespace tessera {

struct ParameterGroup {
  std::string name;  // "table", "density", "colour": the tensor is NAME, the moments NAME.m1, NAME.m2, NAME.count
  Array<float> values, gradients, firstMoments, secondMoments;
  Array<uint32_t> counts;

  ParameterGroup() = default;
  // Without `forTraining` only the values are allocated.
  ParameterGroup(Device& device, std::string groupName, const std::vector<float>& initial, bool forTraining = true);

  // Resets the values to `initial`, and gradients and moments to zero.
  void begin(Device& device, const std::vector<float>& initial);

  // Performs one step of Adam with the accumulated gradients, and clears them.
  void step(Device& device, Adam settings);

  bool allFinite(Device& device) const;  // whether all values are finite; waits for the device
};

// The tensors of a checkpoint by name. Owns their bytes.
class TensorSet {
 public:
  template <class T>
  void add(const std::string& name, std::vector<T> values) {
    const auto owner = std::make_shared<const std::vector<T>>(std::move(values));
    tensors_[name] = {elementTensorType<T>(), static_cast<int64_t>(owner->size()),
                      std::as_bytes(std::span<const T>(*owner)), owner};
  }
  void add(const std::string& name, const TensorView& tensor) {
    const auto owner = std::make_shared<const Bytes>(tensor.bytes.begin(), tensor.bytes.end());
    tensors_[name] = {tensor.type, tensor.elements(), *owner, owner};
  }
  void add(Device& device, const ParameterGroup& group, bool withMoments);
  Bytes encode(const std::map<std::string, std::string>& metadata) const;

 private:
  template <class T>
  static constexpr TensorType elementTensorType() {
    if constexpr (std::is_same_v<T, float>) return TensorType::f32;
    if constexpr (std::is_same_v<T, uint32_t>) return TensorType::u32;
    if constexpr (std::is_same_v<T, int64_t>) return TensorType::i64;
    if constexpr (std::is_same_v<T, double>) return TensorType::f64;
  }

  struct Owned {
    TensorType type;
    int64_t elements;
    std::span<const std::byte> bytes;
    std::shared_ptr<const void> owner;
  };
  std::map<std::string, Owned> tensors_;
};

// Loads a group from a file. Throws Error naming `path` if a tensor is missing or has another size. Moments are
// optional in the file (a file for rendering has none), and are skipped if the group has none.
void loadGroup(Device& device, const fs::path& path, const Safetensors& file, ParameterGroup& group);

}  // namespace tessera

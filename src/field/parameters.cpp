#include "field/parameters.h"

#include <fmt/format.h>

#include <algorithm>

#include "base/error.h"

namespace tessera {

ParameterGroup::ParameterGroup(Device& device, std::string groupName, const std::vector<float>& initial,
                               bool forTraining)
    : name(std::move(groupName)), values(device.uploadArray(initial)) {
  if (!forTraining) return;
  for (Array<float>* each : {&gradients, &firstMoments, &secondMoments}) *each = device.array<float>(initial.size());
  counts = device.array<uint32_t>(initial.size());
}

void ParameterGroup::begin(Device& device, const std::vector<float>& initial) {
  CHECK(initial.size() == values.size());
  device.write(values.all(), std::span<const float>(initial));
  for (const Array<float>* each : {&gradients, &firstMoments, &secondMoments}) device.fillZero(each->all());
  device.fillZero(counts.all());
}

void ParameterGroup::step(Device& device, Adam settings) {
  settings.parameters = values;
  settings.gradients = gradients;
  settings.firstMoments = firstMoments;
  settings.secondMoments = secondMoments;
  settings.counts = counts;
  device.run(settings);
}

bool ParameterGroup::allFinite(Device& device) const {
  const std::vector<float> all = device.read(values.all());
  return std::all_of(all.begin(), all.end(), [](float value) { return std::isfinite(value); });
}

void TensorSet::add(Device& device, const ParameterGroup& group, bool withMoments) {
  add(group.name, device.read(group.values.all()));
  if (!withMoments) return;
  add(group.name + ".m1", device.read(group.firstMoments.all()));
  add(group.name + ".m2", device.read(group.secondMoments.all()));
  add(group.name + ".count", device.read(group.counts.all()));
}

Bytes TensorSet::encode(const std::map<std::string, std::string>& metadata) const {
  std::map<std::string, TensorView> views;
  for (const auto& [name, owned] : tensors_) views[name] = {owned.type, {owned.elements}, owned.bytes};
  return encodeSafetensors(views, metadata);
}

namespace {

template <class T>
void loadArray(Device& device, const fs::path& path, const Safetensors& file, const std::string& name, TensorType type,
               Array<T>& to) {
  const TensorView& tensor = file.require(path, name, type);
  if (tensor.elements() != static_cast<int64_t>(to.size())) {
    throw Error(path.string(), "tensor " + name,
                fmt::format("has {} values, but the model's settings require {}", tensor.elements(), to.size()),
                "restore the config.toml that the checkpoint was trained with, or train again");
  }
  device.write(to.all(), tensor.as<T>());
}

}  // namespace

void loadGroup(Device& device, const fs::path& path, const Safetensors& file, ParameterGroup& group) {
  loadArray(device, path, file, group.name, TensorType::f32, group.values);
  if (group.counts.size() == 0 || !file.tensors.contains(group.name + ".m1")) return;
  loadArray(device, path, file, group.name + ".m1", TensorType::f32, group.firstMoments);
  loadArray(device, path, file, group.name + ".m2", TensorType::f32, group.secondMoments);
  loadArray(device, path, file, group.name + ".count", TensorType::u32, group.counts);
}

}  // namespace tessera

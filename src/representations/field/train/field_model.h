// The plain hash-grid radiance field of a whole capture: parameters, occupancy, and where in the world it stands.
#pragma once

#include "field/radiance_field.h"
#include "representations/field/train/config.h"
#include "train/march_rounds.h"
#include "train/occupancy_grid.h"
#include "train/scene_frame.h"

namespace tessera {

// The samples of a set of rays that can be seen, on the device, ray by ray.
struct RaySamples {
  Array<uint32_t> firstSample, rayOfSample;
  Array<float> positions, distances, steps;
  Slice<uint32_t> counters;  // [kCounters], of train/march_rounds.h; whoever samples says where

  static constexpr uint32_t kRounds = 8;
  static constexpr uint32_t kCounters = MarchRounds::kMarched + kRounds;

  RaySamples() = default;
  RaySamples(Device& device, uint32_t rays, uint32_t samples);

  Count samples() const { return {static_cast<uint32_t>(distances.size()), counters.part(MarchRounds::kKept, 1)}; }
  Count finished(uint32_t rays) const { return {rays, counters.part(MarchRounds::kFinished, 1)}; }
};

class FieldModel {
 public:
  FieldModel(Device& device, const FieldConfig& config, const SceneFrame& frame);

  struct Rays {
    uint32_t count;
    Slice<const float> origins, directions, jitter, far;
  };
  // Finds the samples of rays that can be seen (train/march_rounds.h).
  void sample(const Rays& rays, float minTransmittance, RaySamples& seen);

  void refreshOccupancy(uint32_t uniform, uint32_t occupied, uint64_t seed);

  Device& device() { return device_; }
  RadianceField& field() { return field_; }
  OccupancyGrid& occupancy() { return occupancy_; }
  const FieldConfig& config() const { return config_; }
  const MarchSpace& space() const { return space_; }
  const SceneFrame& frame() const { return frame_; }

  // Parameters (with moments for training) and occupancy.
  bool allFinite();
  void save(TensorSet& tensors, bool withMoments);
  void restore(const fs::path& path, const Safetensors& file);

 private:
  void reserve(uint32_t rays, uint32_t samples);

  Device& device_;
  FieldConfig config_;
  SceneFrame frame_;
  MarchSpace space_;
  RadianceField field_;
  OccupancyGrid occupancy_;

  MarchRounds rounds_;
  Array<float> positions_, distances_;  // what marches make, all rounds
};

// A trained model for drawing, from its folder.
std::unique_ptr<FieldModel> loadFieldModel(Device& device, const fs::path& folder);

}  // namespace tessera

// The plain hash-grid radiance field of a whole capture: parameters, occupancy, and where in the world it stands.
#pragma once

#include "field/radiance_field.h"
#include "representations/field/config.h"
#include "train/occupancy_grid.h"
#include "train/scene_frame.h"

namespace tessera {

// Samples of a set of rays on the device: what marching makes and everything later reads.
struct RaySamples {
  Array<uint32_t> firstSample, count, finishedRays, rayOfSample;
  Array<float> positions, distances, steps;

  RaySamples() = default;
  RaySamples(Device& device, uint32_t rays, uint32_t samples);
};

class FieldModel {
 public:
  FieldModel(Device& device, const FieldConfig& config, const SceneFrame& frame);

  struct Rays {
    uint32_t count;
    Slice<const float> origins, directions, jitter, far;
  };
  // Marches rays and keeps what can be seen: samples in front of the point where transmittance has fallen below
  // `minTransmittance`. Densities are looked up in stages from the front, so that what lies behind surfaces costs
  // little.
  void sample(const Rays& rays, float minTransmittance, RaySamples& marched, RaySamples& kept);

  void refreshOccupancy(uint32_t uniform, uint32_t occupied, uint64_t seed);

  Device& device() { return device_; }
  RadianceField& field() { return field_; }
  OccupancyGrid& occupancy() { return occupancy_; }
  const FieldConfig& config() const { return config_; }
  const MarchSpace& space() const { return space_; }
  const SceneFrame& frame() const { return frame_; }

  // Parameters (with moments for training) and occupancy.
  void save(TensorSet& tensors, bool withMoments);
  void restore(const fs::path& path, const Safetensors& file);

 private:
  void reserve(uint32_t rays, uint32_t marched, uint32_t kept);

  Device& device_;
  FieldConfig config_;
  SceneFrame frame_;
  MarchSpace space_;
  RadianceField field_;
  OccupancyGrid occupancy_;
  Array<uint32_t> source_, lookedAt_, selected_, selectedCount_;
  Array<float> selectedPositions_, logDensities_;
};

// A trained model for drawing, from its folder.
std::unique_ptr<FieldModel> loadFieldModel(Device& device, const fs::path& folder);

}  // namespace tessera

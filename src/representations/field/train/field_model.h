// The plain hash-grid radiance field of a whole capture: parameters, occupancy, and placement in the world.
#pragma once

#include "field/radiance_field.h"
#include "representations/field/train/config.h"
#include "train/march_rounds.h"
#include "train/occupancy_grid.h"
#include "train/scene_frame.h"

namespace tessera {

// The visible samples of a set of rays, in device memory, in the order of rays.
struct RaySamples {
  Array<uint32_t> firstSample, rayOfSample;
  Array<float> positions, distances, steps;
  Slice<uint32_t> counters;  // [kCounters], see train/march_rounds.h; set by the caller

  static constexpr uint32_t kRounds = 8;
  static constexpr uint32_t kCounters = MarchRounds::kMarched + kRounds;

  RaySamples() = default;
  RaySamples(Device& device, uint32_t rays, uint32_t samples);

  Count samples() const { return {static_cast<uint32_t>(distances.size()), counters.part(MarchRounds::kVisible, 1)}; }
  Count finished(uint32_t rays) const { return {rays, counters.part(MarchRounds::kFinished, 1)}; }
};

class FieldModel {
 public:
  // Keeps a reference to `device`.
  FieldModel(Device& device, const FieldConfig& config, const SceneFrame& frame);

  struct Rays {
    uint32_t count;
    Slice<const float> origins, directions, jitter, far;
  };
  // Finds the visible samples of rays (train/march_rounds.h).
  void sample(const Rays& rays, float minTransmittance, RaySamples& seen);
  // Finds the visible samples of rays for rendering, and evaluates them: each density once, and the colours of visible
  // samples only. `cells`: those that rays march through, as occupancy().bits(). The output is valid until the next
  // call.
  RadianceField::Output render(const Rays& rays, Slice<const uint32_t> cells, float minTransmittance, RaySamples& seen);

  // Updates the occupancy at `uniform` random cells and `occupied` random occupied cells, see OccupancyGrid::update.
  void refreshOccupancy(uint32_t uniform, uint32_t occupied, uint64_t seed);

  Device& device() { return device_; }
  RadianceField& field() { return field_; }
  OccupancyGrid& occupancy() { return occupancy_; }
  const FieldConfig& config() const { return config_; }
  const MarchSpace& space() const { return space_; }
  const SceneFrame& frame() const { return frame_; }

  // The state consists of the parameters (with moments for training) and the occupancy.
  bool allFinite();
  void save(TensorSet& tensors, bool withMoments);
  void restore(const fs::path& path, const Safetensors& file);

 private:
  void march(const Rays& rays, Slice<const uint32_t> cells, float minTransmittance, uint32_t features,
             RaySamples& seen);
  void reserve(uint32_t rays, uint32_t samples, uint32_t features);

  Device& device_;
  FieldConfig config_;
  SceneFrame frame_;
  MarchSpace space_;
  RadianceField field_;
  OccupancyGrid occupancy_;

  MarchRounds rounds_;
  Array<float> positions_, distances_;  // outputs of marching, of all rounds
};

// Loads a trained model from its folder for rendering. Throws Error if its files are missing or malformed.
std::unique_ptr<FieldModel> loadFieldModel(Device& device, const fs::path& folder);

}  // namespace tessera

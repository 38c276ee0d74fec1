// A `hash` model (NGP-RT): the parameters of all blocks of a scene, what may hold anything, and where in the world they
// stand.
#pragma once

#include "compute/block_march.h"
#include "representations/hash/train/hash_fields.h"
#include "scene/block_grid.h"
#include "train/block_frame.h"
#include "train/march_rounds.h"
#include "train/occupancy_grid.h"

namespace tessera {

// The samples of a set of rays that can be seen, on the device, ray by ray.
struct HashSamples {
  Array<uint32_t> firstSample, rayOfSample, slotOfSample;
  Array<float> positions, distances, steps, middles, widths;  // as MarchBlocks makes them
  Slice<uint32_t> counters;                                   // [kCounters]; whoever samples says where

  static constexpr uint32_t kRounds = 6;
  // Those of train/march_rounds.h, then the corners that each round's samples wanted, and those that the samples wanted
  // that were seen.
  static constexpr uint32_t kFirstTexels = MarchRounds::kMarched + kRounds;
  static constexpr uint32_t kCounters = kFirstTexels + kRounds + 1;

  HashSamples() = default;
  HashSamples(Device& device, uint32_t rays, uint32_t samples);

  Count samples() const { return {static_cast<uint32_t>(distances.size()), counters.part(MarchRounds::kKept, 1)}; }
  Count finished(uint32_t rays) const { return {rays, counters.part(MarchRounds::kFinished, 1)}; }
  HashFields::Samples places() const { return {samples(), slotOfSample.all(), positions.all()}; }
};

class HashModel {
 public:
  static constexpr uint32_t kMostSteps = 1 << 16;  // that a ray may take at most
  // Throws Error where rays through so many blocks could take more.
  HashModel(Device& device, const HashConfig& config, const BlockGrid& grid, bool forTraining = true);

  Device& device() { return device_; }
  const HashConfig& config() const { return config_; }
  const BlockGrid& grid() const { return grid_; }
  const SceneFrame& frame() const { return frame_; }
  const BlockSpace& space() const { return space_; }
  HashFields& fields() { return fields_; }
  ParameterGroup& direction() { return direction_; }  // the network for directions

  // Room for rays' samples in the calls below.
  void reserve(uint32_t rays, uint32_t samples, uint32_t texels);

  struct Rays {
    uint32_t count;
    Slice<const float> origins, directions, jitter, near, far;  // the last three optional
  };
  // Finds the samples of rays that can be seen (train/march_rounds.h).
  void sample(const Rays& rays, float minTransmittance, HashSamples& seen);
  // HashFields::forward of those samples.
  Matrix<const float> featuresOf(HashSamples& seen, bool forBackward);

  // Steps of rays, relative to the longest (the paper's γ).
  double stepScale() const { return stepScale_; }
  // After a training step whose rays had so many samples on average (section 3 of the supplement).
  void adaptStep(double samplesPerRay);

  // Cells that no photo sees hold nothing for good: [blocks][cells]. Throws nothing; a block may be seen by none.
  void exclude(uint32_t block, const std::vector<bool>& visible);
  MarchSpace occupancySpace(uint32_t block) const;  // as occupancy is refreshed
  // Of every block: all cells that can be seen at all, or a share of them.
  void refreshOccupancy(bool everything, uint64_t seed);
  double occupiedFraction();
  std::vector<uint32_t> occupancyOf(uint32_t block) { return occupancy_[block].bitWords(); }

  // Of one block; what all blocks share stands with block 0.
  void save(uint32_t block, TensorSet& tensors, bool withMoments);
  void restore(uint32_t block, const fs::path& path, const Safetensors& file);
  bool allFinite(uint32_t block);

 private:
  void keepTexelCount(HashSamples& seen, uint32_t lookUp);  // of the last
  std::vector<ParameterGroup*> sharedGroups();

  Device& device_;
  HashConfig config_;
  BlockGrid grid_;
  SceneFrame frame_;
  BlockSpace space_;
  HashFields fields_;
  ParameterGroup direction_;
  Array<uint32_t> occupied_;  // bits of all blocks
  std::deque<OccupancyGrid> occupancy_;
  std::vector<bool> seen_;  // [blocks]: by any photo
  double stepScale_ = 1;

  MarchRounds rounds_;
  Array<uint32_t> slots_, rays_;  // what marches make, all rounds
  Array<float> positions_, distances_, middles_, widths_;
  Array<uint32_t> zero_;
  Array<uint32_t> slotOfPoint_;  // of occupancy's points
};

// A trained model for drawing, from its folder.
std::unique_ptr<HashModel> loadHashModel(Device& device, const fs::path& folder);

}  // namespace tessera

// A `hash` model (NGP-RT): the parameters of all blocks of a scene, their occupancy, and their placement in the world.
#pragma once

#include "compute/block_march.h"
#include "representations/hash/train/hash_fields.h"
#include "scene/block_grid.h"
#include "train/block_frame.h"
#include "train/march_rounds.h"
#include "train/occupancy_grid.h"

namespace tessera {

// The visible samples of a set of rays, in device memory, in the order of rays.
struct HashSamples {
  Array<uint32_t> firstSample, rayOfSample, slotOfSample;
  Array<float> positions, distances, steps, middles, widths;  // as in MarchBlocks
  Slice<uint32_t> counters;                                   // [kCounters]; set by the caller

  static constexpr uint32_t kRounds = 6;
  // The counters of train/march_rounds.h are followed by the numbers of lattice corners that each round's samples
  // needed, and the number that the visible samples needed.
  static constexpr uint32_t kFirstTexels = MarchRounds::kMarched + kRounds;
  static constexpr uint32_t kCounters = kFirstTexels + kRounds + 1;

  HashSamples() = default;
  HashSamples(Device& device, uint32_t rays, uint32_t samples);

  Count samples() const { return {static_cast<uint32_t>(distances.size()), counters.part(MarchRounds::kVisible, 1)}; }
  Count finished(uint32_t rays) const { return {rays, counters.part(MarchRounds::kFinished, 1)}; }
  HashFields::Samples places() const { return {samples(), slotOfSample.all(), positions.all()}; }
};

class HashModel {
 public:
  static constexpr uint32_t kMaxSteps = 1 << 16;  // of one ray
  // Throws Error if a ray through all blocks could take more than kMaxSteps. Keeps a reference to `device`.
  HashModel(Device& device, const HashConfig& config, const BlockGrid& grid, bool forTraining = true);

  Device& device() { return device_; }
  const HashConfig& config() const { return config_; }
  const BlockGrid& grid() const { return grid_; }
  const SceneFrame& frame() const { return frame_; }
  const BlockSpace& space() const { return space_; }
  HashFields& fields() { return fields_; }
  ParameterGroup& direction() { return direction_; }  // the network for directions

  // Allocates memory for this many rays, samples and lattice corners in the calls below.
  void reserve(uint32_t rays, uint32_t samples, uint32_t texels);

  struct Rays {
    uint32_t count;
    Slice<const float> origins, directions, jitter, near, far;  // the last three are optional
  };
  // Finds the visible samples of rays (train/march_rounds.h).
  void sample(const Rays& rays, float minTransmittance, HashSamples& seen);
  // Returns HashFields::forward of those samples.
  Matrix<const float> evaluateFeatures(HashSamples& seen, bool forBackward);

  // The step length of rays, relative to the longest (the paper's γ).
  double stepScale() const { return stepScale_; }
  // Adapts the step length after a training step whose rays had this average number of samples (section 3 of the
  // supplement).
  void adaptStep(double samplesPerRay);

  // Marks the cells of a block that no photo sees as permanently empty. `visible`: [cells]. All of them may be
  // invisible.
  void exclude(uint32_t block, const std::vector<bool>& visible);
  MarchSpace occupancySpace(uint32_t block) const;  // the space in which occupancy is refreshed
  // Updates the occupancy of every block: all visible cells, or a fraction of them.
  void refreshOccupancy(bool everything, uint64_t seed);
  double occupiedFraction();
  std::vector<uint32_t> occupancyWords(uint32_t block) { return occupancy_[block].bitWords(); }

  // Save and restore the state of one block. Block 0 includes the parameters that all blocks share. restore() throws
  // Error naming `path` if a tensor is missing or has another size.
  void save(uint32_t block, TensorSet& tensors, bool withMoments);
  void restore(uint32_t block, const fs::path& path, const Safetensors& file);
  bool allFinite(uint32_t block);

 private:
  void keepTexelCount(HashSamples& seen, uint32_t lookUp);  // copies the count of the last look-up to the counters
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
  Array<uint32_t> slots_, rays_;  // outputs of marching, of all rounds
  Array<float> positions_, distances_, middles_, widths_;
  Array<uint32_t> zero_;
  Array<uint32_t> slotOfPoint_;  // of the points at which occupancy is evaluated
};

// Loads a trained model from its folder for rendering. Throws Error if its files are missing or malformed.
std::unique_ptr<HashModel> loadHashModel(Device& device, const fs::path& folder);

}  // namespace tessera

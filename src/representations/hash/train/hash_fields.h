// The features of samples in the blocks of a `hash` model (NGP-RT, section 4). Coarse features and attention are
// evaluated at the corners of each block's lattice and interpolated, fine features come from tables, and both are
// combined.
#pragma once

#include <deque>

#include "compute/device.h"
#include "field/block_fields.h"
#include "representations/hash/train/config.h"

namespace tessera {

class HashFields {
 public:
  // Slot k contains block k. Keeps a reference to `device`. Initial values depend on the config's seed only.
  HashFields(Device& device, const HashConfig& config, uint32_t slots, bool forTraining = true);

  // Allocates memory for this many samples and lattice corners in the calls below.
  void reserve(uint32_t samples, uint32_t texels);
  uint32_t texelCapacity() const { return texels_.capacity; }

  struct Samples {
    Count count;
    Slice<const uint32_t> slotOfSample;  // [capacity]
    Slice<const float> positions;        // [capacity][3] in [0,1] over the blocks' domains
  };
  // Returns 8 columns per sample: log density, diffuse r g b, 4 features. Valid until the next call.
  Matrix<const float> forward(const Samples& samples, bool forBackward);
  // Adds to the gradients of all parameters. Call after forward(…, true) with the same samples.
  void backward(const Samples& samples, Slice<const float> logDensityGradients, Matrix<const float> colourGradients);

  // Returns the number of lattice corners that the last forward needed; waits for the device. If it exceeds
  // texelCapacity(), the corners beyond the capacity counted as zero.
  uint32_t texelsDemanded();
  Slice<const uint32_t> texelCounter() const { return firstTexel_.part(slots(), 1); }

  struct Rates {
    Adam table, fine, network;
  };
  void step(const Rates& rates);  // one optimiser step of all parameters

  uint32_t slots() const { return static_cast<uint32_t>(fine_.size()); }
  std::vector<ParameterGroup*> slotParameterGroups(uint32_t slot);
  // The parameters that all blocks share: the weights of levels if they do not vary, and the mixing network.
  std::vector<ParameterGroup*> sharedGroups();

  const AttentionShape& attention() const { return attention_; }
  const HashGrid& fineGrid() const { return fineGrid_; }
  const VirtualGrid& lattice() const { return lattice_; }
  BlockFields& coarse() { return coarse_; }
  ParameterGroup& fine(uint32_t slot) { return fine_[slot]; }
  ParameterGroup& logits() { return logits_; }

 private:
  static constexpr uint32_t kWidth = AttentionShape::kFeatures;
  static constexpr uint32_t kCoarsePlanes = 2;  // one of features, one of logits

  // Planes of 8 columns: two with the values from the lattice, then one for each fine level.
  Matrix<float> planes(Array<float>& array, uint32_t first, uint32_t count) const;
  Matrix<float> coarsePlanes(Array<float>& array) const { return planes(array, 0, kCoarsePlanes); }
  Matrix<float> finePlanes(Array<float>& array) const { return planes(array, kCoarsePlanes, attention_.levels); }
  Count rowsOfSlot(uint32_t slot) const;
  void lookUpFine(const Samples& samples);
  void spreadFine(const Samples& samples);

  Device& device_;
  bool mixesByNetwork_, forTraining_;
  AttentionShape attention_;
  MlpShape mix_;
  VirtualGrid lattice_;
  HashGrid fineGrid_;
  BlockFields coarse_;
  std::deque<ParameterGroup> fine_;  // [slots]
  ParameterGroup logits_, mixNetwork_;

  uint32_t capacity_ = 0;
  // For the lattices
  Array<uint32_t> marks_, ranks_, firstTexel_;
  Array<float> texelPositions_;
  BlockFieldBatch texels_;
  // For each sample
  Array<float> encoded_, encodedGradients_, features_, mixActivations_, mixGradients_;
  // Samples grouped by slot, if there are several slots
  Array<uint32_t> firstOfSlot_, source_;
  Array<float> groupedPositions_, grouped_;
};

}  // namespace tessera

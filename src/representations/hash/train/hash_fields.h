// The features of samples in the blocks of a `hash` model (NGP-RT, section 4): coarse ones and attention, asked for at
// the corners of each block's lattice and interpolated; fine ones from tables; and how they become one.
#pragma once

#include <deque>

#include "compute/device.h"
#include "field/block_fields.h"
#include "representations/hash/train/config.h"

namespace tessera {

class HashFields {
 public:
  // Slot k holds block k. Keeps a reference to `device`. Values are functions of the config's seed.
  HashFields(Device& device, const HashConfig& config, uint32_t slots, bool forTraining = true);

  // For so many samples and corners of lattices in the calls below.
  void reserve(uint32_t samples, uint32_t texels);
  uint32_t roomForTexels() const { return texels_.capacity; }

  struct Samples {
    Count count;
    Slice<const uint32_t> slotOfSample;  // [capacity]
    Slice<const float> positions;        // [capacity][3] in [0,1] over the blocks' domains
  };
  // 8 columns a sample: the logarithm of density, diffuse r g b, 4 features. Valid until the next call.
  Matrix<const float> forward(const Samples& samples, bool forBackward);
  // After forward(…, true) with the same samples: adds to the gradients of all parameters.
  void backward(const Samples& samples, Slice<const float> logDensityGradients, Matrix<const float> colourGradients);

  // Of the last forward; waits. Where it is above roomForTexels, what was beyond counted as nothing.
  uint32_t texelsWanted();
  Slice<const uint32_t> texelCounter() const { return firstTexel_.part(slots(), 1); }

  struct Rates {
    Adam table, fine, network;
  };
  void step(const Rates& rates);

  uint32_t slots() const { return static_cast<uint32_t>(fine_.size()); }
  // Of a slot; with what all blocks share (`shared`): the weights of levels that do not vary, and the mixing network.
  std::vector<ParameterGroup*> groupsOf(uint32_t slot);
  std::vector<ParameterGroup*> sharedGroups();

  const AttentionShape& attention() const { return attention_; }
  const HashGrid& fineGrid() const { return fineGrid_; }
  const VirtualGrid& lattice() const { return lattice_; }
  BlockFields& coarse() { return coarse_; }
  ParameterGroup& fine(uint32_t slot) { return fine_[slot]; }
  ParameterGroup& logits() { return logits_; }

 private:
  static constexpr uint32_t kWidth = AttentionShape::kFeatures;
  static constexpr uint32_t kCoarsePlanes = 2;  // of features, of logits

  // Planes of 8 columns: two of what the lattice says, then one a fine level.
  Matrix<float> planes(Array<float>& array, uint32_t first, uint32_t count) const;
  Matrix<float> coarseOf(Array<float>& array) const { return planes(array, 0, kCoarsePlanes); }
  Matrix<float> fineOf(Array<float>& array) const { return planes(array, kCoarsePlanes, attention_.levels); }
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
  // Of the lattices
  Array<uint32_t> marks_, ranks_, firstTexel_;
  Array<float> texelPositions_;
  BlockFieldBatch texels_;
  // Of samples
  Array<float> encoded_, encodedGradients_, features_, mixActivations_, mixGradients_;
  // By slot, where there are several
  Array<uint32_t> firstOfSlot_, source_;
  Array<float> groupedPositions_, grouped_;
};

}  // namespace tessera

#include "representations/hash/train/hash_fields.h"

#include "base/random.h"
#include "compute/lattice.h"
#include "compute/rows.h"
#include "field/initial_values.h"

namespace tessera {

HashFields::HashFields(Device& device, const HashConfig& config, uint32_t slots, bool forTraining)
    : device_(device),
      mixesByNetwork_(config.mixesByNetwork()),
      forTraining_(forTraining),
      attention_(config.attentionShape()),
      mix_(config.mixShape()),
      lattice_(config.latticeGrid()),
      fineGrid_(config.fineGrid()),
      coarse_(device, "coarse", config.coarseShape(), slots, mix64(static_cast<uint64_t>(config.seed)), forTraining) {
  const uint64_t seed = mix64(static_cast<uint64_t>(config.seed) + 1);
  for (uint32_t slot = 0; slot < slots; ++slot) {
    fine_.emplace_back(device, "fine.table", initialTable(fineGrid_.parameters(), mix64(seed ^ (uint64_t{slot} << 32))),
                       forTraining);
  }
  if (mixesByNetwork_) {
    mixNetwork_ = ParameterGroup(device, "mix.network", initialWeights(mix_, seed, 0x313), forTraining);
  } else if (!attention_.varies && attention_.logits() > 0) {
    logits_ = ParameterGroup(device, "attention", std::vector<float>(attention_.logits()), forTraining);
  }
  const size_t words = size_t{slots} * lattice_.words();
  marks_ = device.array<uint32_t>(words);
  ranks_ = device.array<uint32_t>(words);
  firstTexel_ = device.array<uint32_t>(slots + size_t{1});
  firstOfSlot_ = device.array<uint32_t>(slots + size_t{1});
}

void HashFields::reserve(uint32_t samples, uint32_t texels) {
  if (samples > capacity_) {
    capacity_ = samples;
    const size_t n = samples, planes = Matrix<float>::rowsOfPlane(n) * kWidth;
    encoded_ = device_.array<float>(planes * (kCoarsePlanes + attention_.levels));
    features_ = device_.array<float>(n * kWidth);
    if (mixesByNetwork_) mixActivations_ = device_.allocateActivations(mix_, n);
    if (forTraining_) {
      encodedGradients_ = device_.array<float>(encoded_.size());
      if (mixesByNetwork_) mixGradients_ = device_.array<float>(n * kWidth);
    }
    if (slots() > 1) {
      source_ = device_.array<uint32_t>(n);
      groupedPositions_ = device_.array<float>(3 * n);
      grouped_ = device_.array<float>(planes * attention_.levels);
    }
  }
  if (texels > texels_.capacity) {
    texelPositions_ = device_.array<float>(size_t{3} * texels);
    texels_ = BlockFieldBatch(device_, coarse_.shape(), texels, forTraining_);
    texels_.firstOfSlot = firstTexel_;
    texels_.positions = texelPositions_;
  }
}

Matrix<float> HashFields::planes(Array<float>& array, uint32_t first, uint32_t count) const {
  const size_t rows = Matrix<float>::rowsOfPlane(capacity_), plane = rows * kWidth;
  return Matrix<float>::grouped(array.part(first * plane, count * plane), count * kWidth, kWidth, rows);
}

Count HashFields::rowsOfSlot(uint32_t slot) const {
  return {capacity_, firstOfSlot_.part(slot + 1, 1), firstOfSlot_.part(slot, 1)};
}

void HashFields::lookUpFine(const Samples& samples) {
  if (slots() == 1) {
    device_.run(HashGridForward{fineGrid_, samples.count, samples.positions, fine_[0].values, finePlanes(encoded_)});
    return;
  }
  device_.run(GroupByBlock{samples.count, slots(), samples.slotOfSample, firstOfSlot_, source_});
  device_.run(GatherRows{samples.count, source_, Matrix<const float>(samples.positions, 3),
                         Matrix<float>(groupedPositions_, 3)});
  const Matrix<float> grouped = planes(grouped_, 0, attention_.levels);
  for (uint32_t slot = 0; slot < slots(); ++slot) {
    device_.run(HashGridForward{fineGrid_, rowsOfSlot(slot), groupedPositions_, fine_[slot].values, grouped});
  }
  device_.run(ScatterRows{samples.count, source_, grouped, finePlanes(encoded_)});
}

void HashFields::spreadFine(const Samples& samples) {
  if (slots() == 1) {
    device_.run(HashGridBackward{fineGrid_,
                                 samples.count,
                                 samples.positions,
                                 fine_[0].values,
                                 finePlanes(encodedGradients_),
                                 fine_[0].gradients,
                                 {}});
    return;
  }
  const Matrix<float> grouped = planes(grouped_, 0, attention_.levels);
  device_.run(GatherRows{samples.count, source_, finePlanes(encodedGradients_), grouped});
  for (uint32_t slot = 0; slot < slots(); ++slot) {
    device_.run(HashGridBackward{
        fineGrid_, rowsOfSlot(slot), groupedPositions_, fine_[slot].values, grouped, fine_[slot].gradients, {}});
  }
}

Matrix<const float> HashFields::forward(const Samples& samples, bool forBackward) {
  CHECK(samples.count.capacity <= capacity_);
  DistinctTexels distinct{lattice_};
  distinct.blocks = slots();
  distinct.samples = samples.count;
  distinct.blockOfSample = samples.slotOfSample;
  distinct.positions = samples.positions;
  distinct.texelCapacity = texels_.capacity;
  distinct.marks = marks_;
  distinct.ranks = ranks_;
  distinct.firstTexel = firstTexel_;
  distinct.texelPositions = texelPositions_;
  device_.run(distinct);
  coarse_.forward(texels_, forBackward);
  LatticeForward mix{lattice_};
  mix.samples = samples.count;
  mix.blockOfSample = samples.slotOfSample;
  mix.positions = samples.positions;
  mix.marks = marks_;
  mix.ranks = ranks_;
  mix.texels = {texels_.capacity, texelCounter()};
  mix.values = texels_.outputs;
  mix.mixed = coarsePlanes(encoded_);
  device_.run(mix);
  lookUpFine(samples);
  const Matrix<float> features(features_, kWidth);
  if (mixesByNetwork_) {
    device_.run(MlpForward{mix_, samples.count, planes(encoded_, 0, kCoarsePlanes + attention_.levels),
                           mixNetwork_.values, features, forBackward ? mixActivations_.all() : Slice<float>()});
  } else {
    device_.run(AttentionForward{attention_, samples.count, coarsePlanes(encoded_), finePlanes(encoded_),
                                 logits_.values, features});
  }
  return features;
}

void HashFields::backward(const Samples& samples, Slice<const float> logDensityGradients,
                          Matrix<const float> colourGradients) {
  if (mixesByNetwork_) {
    const uint32_t all = kCoarsePlanes + attention_.levels;
    const Matrix<float> gradients(mixGradients_, kWidth);
    device_.fillZero(mixGradients_.all());
    device_.run(AddColumns{samples.count, colourGradients, gradients.columnRange(1, kWidth - 1)});
    device_.run(MlpBackward{mix_, samples.count, planes(encoded_, 0, all), mixNetwork_.values,
                            Matrix<float>(features_, kWidth), mixActivations_, gradients, logDensityGradients,
                            mixNetwork_.gradients, planes(encodedGradients_, 0, all)});
  } else {
    AttentionBackward fuse{attention_};
    fuse.samples = samples.count;
    fuse.coarse = coarsePlanes(encoded_);
    fuse.fine = finePlanes(encoded_);
    fuse.logits = logits_.values;
    fuse.logDensityGradients = logDensityGradients;
    fuse.colourGradients = colourGradients;
    fuse.coarseGradients = coarsePlanes(encodedGradients_);
    fuse.fineGradients = finePlanes(encodedGradients_);
    fuse.logitGradients = logits_.gradients;
    device_.run(fuse);
  }
  spreadFine(samples);
  LatticeBackward mix{lattice_};
  mix.blocks = slots();
  mix.samples = samples.count;
  mix.blockOfSample = samples.slotOfSample;
  mix.positions = samples.positions;
  mix.marks = marks_;
  mix.ranks = ranks_;
  mix.firstTexel = firstTexel_;
  mix.texels = {texels_.capacity, texelCounter()};
  mix.mixedGradients = coarsePlanes(encodedGradients_);
  mix.valueGradients = texels_.outputGradients;
  device_.run(mix);
  coarse_.backward(texels_);
}

uint32_t HashFields::texelsDemanded() {
  return device_.read(texelCounter())[0];
}

void HashFields::step(const Rates& rates) {
  for (uint32_t slot = 0; slot < slots(); ++slot) {
    Adam table = rates.table, fine = rates.fine, network = rates.network;
    table.rows = fine.rows = network.rows = firstTexel_.part(slot, 2);
    coarse_.table(slot).step(device_, table);
    coarse_.network(slot).step(device_, network);
    fine_[slot].step(device_, fine);
  }
  for (ParameterGroup* group : sharedGroups()) group->step(device_, rates.network);
}

std::vector<ParameterGroup*> HashFields::slotParameterGroups(uint32_t slot) {
  return {&coarse_.table(slot), &coarse_.network(slot), &fine_[slot]};
}

std::vector<ParameterGroup*> HashFields::sharedGroups() {
  std::vector<ParameterGroup*> groups;
  if (mixNetwork_.values.size() > 0) groups.push_back(&mixNetwork_);
  if (logits_.values.size() > 0) groups.push_back(&logits_);
  return groups;
}

}  // namespace tessera

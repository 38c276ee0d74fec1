// The weights of the fine levels' features (src/compute/attention.h).
// Reads: AttentionArguments. Defines: kFeatures, kLevels, kWeights, kVaries, logitIndex(), logitCount(), sigmoid(),
// levelWeight().

const uint kFeatures = 8;
const float kMaxDensity = 15;  // the largest log-density
const uint kNone = 0, kShared = 1, kSeparate = 2;

layout(constant_id = 0) const uint kLevels = 2;
layout(constant_id = 1) const uint kWeights = kSeparate;
layout(constant_id = 2) const bool kVaries = true;

uint logitIndex(uint level, uint feature) { return kWeights == kShared ? level : 2 * level + min(feature, 1); }
uint logitCount() { return kWeights == kNone ? 0 : kWeights == kShared ? kLevels : 2 * kLevels; }

float sigmoid(float x) { return 1 / (1 + exp(-x)); }

float levelWeight(AttentionArguments a, uint row, uint logit) {
  if (kWeights == kNone) return 1;
  return sigmoid(kVaries ? a.coarse.data.values[elementIndex(a.coarse, row, kFeatures + logit)] : a.logits.values[logit]);
}

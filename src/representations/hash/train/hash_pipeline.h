// The forward and backward computation of rays through a `hash` model (NGP-RT, sections 3 and 4): samples at the steps
// of a renderer, features that are composited over all blocks, and one evaluation per ray of the network for
// direction-dependent colour.
#pragma once

#include "representations/hash/train/hash_model.h"

namespace tessera {

class HashPipeline {
 public:
  struct Capacity {
    uint32_t rays = 0, samples = 0, texels = 0;
    bool training = false;
  };
  // Keeps a reference to `model`.
  HashPipeline(HashModel& model, const Capacity& capacity);

  // Finds samples and composites them. Rays whose samples do not fit are not finished; finished() counts those that
  // are.
  void forward(const HashModel::Rays& rays, float minTransmittance);

  Slice<const float> colour() const { return colour_; }    // [rays][3]; on black, unless the background is learned
  Slice<const float> sums() const { return composited_; }  // [rays][7]: composited diffuse colour and features
  Slice<const float> opacity() const { return opacity_; }  // [rays]
  Slice<const float> depth() const { return depth_; }      // [rays]: expected t, times opacity
  const HashSamples& samples() const { return seen_; }
  Slice<const float> weights() const { return weights_; }  // [samples]
  Count finished(const HashModel::Rays& rays) const { return seen_.finished(rays.count); }
  Slice<const uint32_t> counters() const { return counters_; }  // HashSamples::kCounters
  // The counters of lattice corners that each round of marching and the visible samples needed. If one exceeds
  // HashFields::texelCapacity(), the corners beyond the capacity counted as zero.
  Slice<const uint32_t> texelsDemanded() const {
    return counters_.part(HashSamples::kFirstTexels, HashSamples::kRounds + 1);
  }

  // Scales of the losses on samples' weights, already divided by the number of rays. The caller computes the colour
  // loss.
  struct LossScales {
    float distortion = 0, depth = 0, depthTolerance = 0;
  };
  // Adds to the gradients of the model's parameters, and to `opacityGradients`. Call after forward with the same rays.
  // `known`: [rays], the known distances, used with a depth loss.
  void backward(const HashModel::Rays& rays, Slice<const float> colourGradients, Slice<float> opacityGradients,
                Slice<const float> known, const LossScales& scales);
  Slice<const float> losses() const { return losses_; }  // [kLosses]: distortion and depth loss of the last backward
  static constexpr uint32_t kLosses = 2;

 private:
  static constexpr uint32_t kColours = AttentionShape::kFeatures - 1, kHarmonics = 16, kInputs = kColours + kHarmonics;
  void shade(const HashModel::Rays& rays);
  bool hasLearnedBackground() const { return model_.config().background == "learned"; }

  HashModel& model_;
  Device& device_;
  Capacity capacity_;
  float minTransmittance_ = 0;
  HashSamples seen_;
  Matrix<const float> features_;
  Array<uint32_t> counters_;
  // For each ray
  Array<float> composited_, opacity_, depth_, inputs_, activations_, specular_, colour_, losses_;
  Array<float> compositedGradients_, inputGradients_;
  // For each sample
  Array<float> weights_, weightGradients_, logDensityGradients_, colourGradients_;
};

}  // namespace tessera

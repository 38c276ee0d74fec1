// Rays through a `hash` model, forward and backward (NGP-RT, sections 3 and 4): samples in the steps of a renderer,
// their features composited, blocks and all, and one network for what depends on the direction of the ray.
#pragma once

#include "representations/hash/train/hash_model.h"

namespace tessera {

class HashPass {
 public:
  struct Room {
    uint32_t rays = 0, samples = 0, texels = 0;
    bool training = false;
  };
  // Keeps a reference to `model`.
  HashPass(HashModel& model, const Room& room);

  // Finds samples and composites them; rays that do not fit are not finished (finished()).
  void forward(const HashModel::Rays& rays, float minTransmittance);

  Slice<const float> colour() const { return colour_; }    // [rays][3]; black behind, unless the background is learned
  Slice<const float> sums() const { return composited_; }  // [rays][7]: of diffuse colours and what the network takes
  Slice<const float> opacity() const { return opacity_; }  // [rays]
  Slice<const float> depth() const { return depth_; }      // [rays]: expected t, times opacity
  const HashSamples& samples() const { return seen_; }
  Slice<const float> weights() const { return weights_; }  // [samples]
  Count finished(const HashModel::Rays& rays) const { return seen_.finished(rays.count); }
  Slice<const uint32_t> counters() const { return counters_; }  // HashSamples::kCounters
  // Of those: corners of lattices, of each round of marching and of what is seen. Where one is above the fields' room,
  // some counted as nothing.
  Slice<const uint32_t> texelsWanted() const {
    return counters_.part(HashSamples::kFirstTexels, HashSamples::kRounds + 1);
  }

  // Of the losses on samples' weights, already divided by the number of rays; the colour's gradients come from outside.
  struct LossScales {
    float distortion = 0, depth = 0, depthTolerance = 0;
  };
  // After forward with the same rays: adds to the gradients of the model's parameters. `known`: [rays], distances, with
  // a depth loss. Opacity gradients are added to.
  void backward(const HashModel::Rays& rays, Slice<const float> colourGradients, Slice<float> opacityGradients,
                Slice<const float> known, const LossScales& scales);
  Slice<const float> losses() const { return losses_; }  // distortion, depth; of the last backward
  static constexpr uint32_t kLosses = 2;

 private:
  static constexpr uint32_t kColours = AttentionShape::kFeatures - 1, kHarmonics = 16, kInputs = kColours + kHarmonics;
  void shade(const HashModel::Rays& rays);
  bool isWhole() const { return model_.config().background == "learned"; }

  HashModel& model_;
  Device& device_;
  Room room_;
  float minTransmittance_ = 0;
  HashSamples seen_;
  Matrix<const float> features_;
  Array<uint32_t> counters_;
  // Rays
  Array<float> composited_, opacity_, depth_, inputs_, activations_, specular_, colour_, losses_;
  Array<float> compositedGradients_, inputGradients_;
  // Samples
  Array<float> weights_, weightGradients_, logDensityGradients_, colourGradients_;
};

}  // namespace tessera

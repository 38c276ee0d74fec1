// Rays through a volume model, forward and backward (City-on-Web, section 4.2): proposals say where to look, samples
// are interpolated from the virtual grids of their blocks, each block composites its own and shades them once, and
// blocks are blended in order. What a renderer of baked tiles does, so that training sees what will be drawn.
#pragma once

#include "compute/device.h"
#include "representations/volume/train/volume_model.h"

namespace tessera {

struct VolumeRays {
  uint32_t count = 0;
  Slice<const float> origins, directions;  // [count][3], scene units
  Slice<const float> jitter;               // optional, [kRounds + 1][count], in [0,1)
  Slice<const float> far;                  // optional, [count]: rays end there
  Slice<const float> near;                 // optional, [count]: and begin there
};

class VolumePass {
 public:
  static constexpr uint32_t kRounds = 2;  // of proposals, at most

  struct Room {
    uint32_t rays = 0, texels = 0;
    uint32_t mostWords = 0;  // of virtual grids that the model will look through, where finer than its own
    uint32_t samples = 0;    // of a ray; 0: as many as in training
    uint32_t points = 0;     // random ones, for the sparsity loss; their rows come before those of rays
    bool training = false;
  };
  // Keeps a reference to `model`.
  VolumePass(VolumeModel& model, const Room& room);

  struct Options {
    float anneal = 1;    // of proposals
    float padding = 0;   // of proposals, if more than the model's
    float minAlpha = 0;  // samples below are culled
    uint64_t seed = 0;   // of random points
    bool keepProposals = false;
    bool keepAttributes = true;  // else only deferred networks can be trained
  };
  void forward(const VolumeRays& rays, const Options& options);

  // Of the rays of the last forward.
  Slice<const float> colour() const { return colour_; }    // [rays][3], black behind
  Slice<const float> opacity() const { return opacity_; }  // [rays]
  Slice<const float> depth() const { return depth_; }      // [rays]: expected t, times opacity
  // Per sample; rows [firstSample[r], firstSample[r + 1]).
  Slice<const uint32_t> firstSample() const { return firstSample_; }
  Slice<const uint32_t> blockOfSample() const { return blockOfSample_; }  // the slot that holds it
  Slice<const float> positions() const { return positions_; }
  Slice<const float> weights() const { return weights_; }  // over the whole ray
  Slice<const float> logDensities() const { return logDensities_; }
  Slice<const float> colours() const { return colours_; }  // [7]: diffuse, features
  Slice<const float> runtimeSteps() const { return runtimeSteps_; }
  Slice<const uint32_t> texelsWanted() const {  // [1], may be above the room there is
    return firstTexel_.part(model_.slots(), 1);
  }
  uint32_t roomForTexels() const { return room_.texels; }
  // Of the texels that a slot's field was asked for; both the same when no sample came to its block.
  Slice<const uint32_t> texelRows(uint32_t slot) const { return firstTexel_.part(slot, 2); }

  // Weights of the losses that live inside the model, already divided by the number of rays or points; the colour's
  // gradients come from outside.
  struct LossScales {
    float interlevel = 0, distortion = 0, sparsity = 0, opacity = 0;
  };
  static constexpr uint32_t kLosses = 5;  // distortion, sparsity, opacity, interlevel of both rounds
  // Adds to the gradients of the model's parameters. With keepProposals only, proposals are trained too.
  void backward(const VolumeRays& rays, Slice<const float> colourGradients, Slice<const float> opacityGradients,
                const LossScales& scales);
  Slice<const float> losses() const { return losses_; }  // [kLosses], as of the last backward

 private:
  struct Round {
    uint32_t intervals = 0;
    Array<float> fences;  // [rays][intervals + 1]
    Array<uint32_t> firstSample, rowCount, blockOfSample, firstOfSlot, source;
    Array<float> positions, groupedPositions, distances, steps, logDensities, weights, opacity, weightGradients,
        gradients;
    BlockFieldBatch batch;
  };
  void propose(const VolumeRays& rays, uint32_t round, const Options& options);
  void locateSamples(const VolumeRays& rays);
  void evaluateTexels(const Options& options);
  void composite(const VolumeRays& rays);
  void backwardThroughBlocks(const VolumeRays& rays, Slice<const float> colourGradients,
                             Slice<const float> opacityGradients, const LossScales& scales);
  void backwardThroughTexels(const LossScales& scales);
  void backwardThroughProposals(const VolumeRays& rays, const LossScales& scales);
  Slice<const float> jitterOf(const VolumeRays& rays, uint32_t round) const;
  uint32_t samples() const {
    return room_.samples > 0 ? room_.samples : static_cast<uint32_t>(model_.config().samples);
  }
  uint32_t rounds() const { return model_.config().secondIntervals > 0 ? 2 : 1; }
  Count rows() const { return {rowCapacity_, rowCount_}; }
  Count segments() const { return {segmentCapacity_, segmentCount_}; }

  VolumeModel& model_;
  Device& device_;
  Room room_;
  uint32_t rowCapacity_ = 0, segmentCapacity_ = 0;
  bool keptProposals_ = false, keptAttributes_ = true;
  Array<float> range_;
  Round round_[kRounds];
  Array<float> fences_;  // of the samples

  // Samples
  Array<uint32_t> firstSample_, rowCount_, blockOfSample_;
  Array<float> positions_, distances_, steps_, middles_, widths_, runtimeSteps_;
  Array<uint32_t> firstSegment_, segmentCount_, firstSampleOfSegment_, groupOfSegment_, rayOfSegment_;
  Array<uint32_t> marks_, ranks_, firstTexel_;
  Array<float> texelPositions_;
  BlockFieldBatch texels_;
  Array<float> logDensities_, colours_, weights_, segmentWeights_;
  Array<float> logDensityGradients_, colourGradients_, weightGradients_;
  // Segments and rays
  Array<float> composited_, segmentOpacity_, segmentDepth_, specular_;
  Array<float> compositedGradients_, segmentOpacityGradients_, specularGradients_;
  Array<float> colour_, opacity_, depth_, rayOpacity_, losses_;
};

}  // namespace tessera

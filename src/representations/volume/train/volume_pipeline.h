// Evaluates rays through a volume model, forward and backward (City-on-Web, section 4.2). Proposals choose where to
// sample; samples are interpolated from the virtual grids of their blocks; each block composites its own samples and
// shades the result once; blocks are blended in order. This is what a renderer of baked tiles does, so that training
// optimises what will be rendered.
#pragma once

#include "compute/device.h"
#include "representations/volume/train/volume_model.h"

namespace tessera {

struct VolumeRays {
  uint32_t count = 0;
  Slice<const float> origins, directions;  // [count][3], scene units
  Slice<const float> jitter;               // optional, [kRounds + 1][count], in [0,1)
  Slice<const float> far;                  // optional, [count]: distance at which rays end
  Slice<const float> near;                 // optional, [count]: distance at which rays begin
};

class VolumePipeline {
 public:
  static constexpr uint32_t kRounds = 2;  // the largest number of proposal rounds

  struct Capacity {
    uint32_t rays = 0, texels = 0;
    uint32_t maxWords = 0;  // of the finest virtual grid that the model will be given, if finer than its own
    uint32_t samples = 0;   // per ray; 0: as many as in training
    uint32_t points = 0;    // random points of the sparsity loss; their rows precede those of rays
    bool training = false;
  };
  // Keeps a reference to `model`.
  VolumePipeline(VolumeModel& model, const Capacity& capacity);

  struct Options {
    float anneal = 1;            // annealing exponent of proposals
    float uniformFraction = 0;   // of samples spread evenly, if larger than the model's setting
    float minAlpha = 0;          // samples of lower opacity are culled
    uint64_t seed = 0;           // of the random points
    bool keepProposals = false;  // store the proposals' activations, so that backward can train them
    bool keepAttributes = true;  // otherwise only deferred networks can be trained
  };
  void forward(const VolumeRays& rays, const Options& options);

  // Results for the rays of the last forward().
  Slice<const float> colour() const { return colour_; }    // [rays][3], over black
  Slice<const float> opacity() const { return opacity_; }  // [rays]
  Slice<const float> depth() const { return depth_; }      // [rays]: expected distance, premultiplied by opacity
  // Results per sample. The samples of ray r are rows [firstSample[r], firstSample[r + 1]).
  Slice<const uint32_t> firstSample() const { return firstSample_; }
  Slice<const uint32_t> blockOfSample() const { return blockOfSample_; }  // the slot of its block
  Slice<const float> positions() const { return positions_; }
  Slice<const float> weights() const { return weights_; }  // over the whole ray
  Slice<const float> logDensities() const { return logDensities_; }
  Slice<const float> colours() const { return colours_; }  // [rows][7]: diffuse colour, features
  Slice<const float> runtimeSteps() const { return runtimeSteps_; }
  // [1]: may exceed texelCapacity().
  Slice<const uint32_t> texelsDemanded() const { return firstTexel_.part(model_.slots(), 1); }
  uint32_t texelCapacity() const { return capacity_.texels; }
  // The first and one past the last of the texels at which a slot's field was evaluated, [2]; equal if no sample was in
  // its block.
  Slice<const uint32_t> texelRows(uint32_t slot) const { return firstTexel_.part(slot, 2); }

  // Weights of the losses that are computed inside the pipeline, already divided by the number of rays or points. The
  // gradients of the colour loss are passed to backward().
  struct LossScales {
    float interlevel = 0, distortion = 0, sparsity = 0, opacity = 0;
  };
  static constexpr uint32_t kLosses = 5;  // distortion, sparsity, opacity, interlevel of each round
  // Adds to the gradients of the model's parameters; to those of proposals only after a forward() with keepProposals.
  void backward(const VolumeRays& rays, Slice<const float> colourGradients, Slice<const float> opacityGradients,
                const LossScales& scales);
  Slice<const float> losses() const { return losses_; }  // [kLosses], of the last backward()

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
  Slice<const float> roundJitter(const VolumeRays& rays, uint32_t round) const;
  uint32_t samples() const {
    return capacity_.samples > 0 ? capacity_.samples : static_cast<uint32_t>(model_.config().samples);
  }
  uint32_t rounds() const { return model_.config().secondIntervals > 0 ? 2 : 1; }
  Count rows() const { return {rowCapacity_, rowCount_}; }
  Count segments() const { return {segmentCapacity_, segmentCount_}; }

  VolumeModel& model_;
  Device& device_;
  Capacity capacity_;
  uint32_t rowCapacity_ = 0, segmentCapacity_ = 0;
  bool keptProposals_ = false, keptAttributes_ = true;
  Array<float> range_;
  Round round_[kRounds];
  Array<float> fences_;  // of the final samples

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

// The final stage of training, which the paper lacks: with frozen triangles, the networks are trained through the atlas
// as a renderer will draw it. Texels come from the encoder, are stored in 8 bits (with a gradient that ignores the
// rounding) and mixed bilinearly; every hit is decoded, and all hits are composited. So what is lost between the model
// and its contents becomes part of the loss.
#pragma once

#include "representations/mesh/train/texel_atlas.h"
#include "train/photo_loss.h"

namespace tessera {

class AtlasStage {
 public:
  static constexpr uint32_t kLosses = PhotoLoss::kLosses + 1;     // of the photos, and of dithering
  static constexpr uint32_t kCounters = MeshHits::kCounters + 1;  // of hits, of rays, of texels

  // `atlas`: of that level's faces. Keeps a reference to `model`. hitCapacity: of a step.
  AtlasStage(MeshModel& model, uint32_t level, TexelAtlas atlas, uint32_t maxRays, uint32_t hitCapacity);

  // Adds the gradients of a step's first `count` rays to those of the networks, the table and the sky, or to those of
  // the texels of a coarser level. `losses`: [kLosses];
  // `counters`: [kCounters].
  void addGradients(const PhotoRays& rays, uint32_t count, PhotoLoss& photoLoss, Slice<float> losses,
                    Slice<uint32_t> counters);
  // The composited colours and opacities of the last rays, [rays][3] and [rays].
  Slice<const float> colours() const { return colour_.all(); }
  Slice<const float> opacities() const { return opacity_.all(); }

 private:
  struct Step;
  void lookUp(const Step& step);
  void composite(const Step& step, PhotoLoss& photoLoss);

  Matrix<float> encodedFeatures();

  MeshModel& model_;
  uint32_t level_;
  Device& device_;
  TexelAtlas atlas_;
  uint32_t texelCapacity_;
  MeshHits hits_;
  Array<uint32_t> texels_, rows_, marks_, ranks_, rowIds_;
  Array<float> ranges_, weights_, texelPositions_, stored_, storedGradients_, featureGradients_, features_;
  Array<float> opacities_, opacityGradients_, sampleWeights_, weightGradients_, colourGradients_, ditherGradients_;
  Array<float> colour_, opacity_, skyColour_, ditherColourGradients_;
};

}  // namespace tessera

// The field of UE4-NeRF (Gu et al. 2023, section 3.1.2): a hash grid and an encoder give 8 features of a point, the
// first of which is the logit of its opacity; a decoder gives the colour of the features seen from a direction.
#pragma once

#include "compute/hash_grid.h"
#include "compute/mlp.h"
#include "field/parameters.h"

namespace tessera {

struct MeshFieldShape {
  HashGrid grid;
  MlpShape encoder;  // grid columns → features
  MlpShape decoder;  // features + harmonics → 16 → 16 → 3, sigmoid
  int harmonicsDegree = 3;
};

MeshFieldShape makeMeshFieldShape(const HashGridOptions& grid, int encoderWidth, int encoderHidden);

class MeshField {
 public:
  static constexpr int kFeatures = 8;

  // Initialises the table to U(±1e-4) and the networks to Xavier uniform on padded sizes, as a function of `seed`
  // alone. Without `forTraining`, no backward function may be called. Keeps a reference to `device`.
  MeshField(Device& device, MeshFieldShape shape, uint64_t seed, bool forTraining = true);

  // Allocates memory for this many samples in the calls below.
  void reserve(uint32_t samples);
  uint32_t capacity() const { return capacity_; }

  // Evaluates the encoder alone, without activations for backward. positions: [capacity][3] in [0,1]; `features`:
  // receives the first features, as many as it has columns.
  void encode(Count samples, Slice<const float> positions, Matrix<float> features);

  struct Output {
    Matrix<const float> logits;   // 1 column, without the offset
    Matrix<const float> colours;  // 3 columns
  };
  // Evaluates both networks; `forBackward` stores the activations. directions: [rays][3]; rayOfSample: [capacity].
  // The output is valid until the next call.
  Output forward(Count samples, Slice<const float> positions, Slice<const float> directions,
                 Slice<const uint32_t> rayOfSample, bool forBackward);
  // Call it after `forward` with the same samples. Adds to the gradients of the parameter groups, if it `trains` them,
  // and overwrites `positionGradients`, [capacity][3], if given; one of both at least.
  void backward(Count samples, Slice<const float> positions, Slice<const float> logitGradients,
                Matrix<const float> colourGradients, bool trains, Slice<float> positionGradients);

  // The two networks apart, for texels that the encoder is evaluated at and hits that the decoder is evaluated at.
  // `encodeForBackward` sets encodedFeatures(), [capacity][kFeatures]. Write decoderFeatures() before `decode`, which
  // returns the colours. The backward functions add to the gradients of the parameter groups; `decodeBackward` returns
  // those of decoderFeatures(), and does so alone unless it `trains` the decoder. All are valid until the next call of
  // another function.
  void encodeForBackward(Count texels, Slice<const float> positions);
  Matrix<float> encodedFeatures() { return Matrix<float>(texelFeatures_, kFeatures); }
  // `logitGradients`: optional, [capacity], added to those of the first feature.
  void encodeBackward(Count texels, Slice<const float> positions, Matrix<const float> featureGradients,
                      Slice<const float> logitGradients = {});
  Matrix<float> decoderFeatures() { return features(); }
  Matrix<const float> decode(Count hits, Slice<const float> directions, Slice<const uint32_t> rayOfHit);
  Matrix<const float> decodeBackward(Count hits, Matrix<const float> colourGradients, bool trains);

  ParameterGroup& table() { return table_; }
  ParameterGroup& encoder() { return encoder_; }
  ParameterGroup& decoder() { return decoder_; }
  const MeshFieldShape& shape() const { return shape_; }

 private:
  Matrix<float> byLevel(Array<float>& encodings);
  Matrix<float> features() {
    return Matrix<float>(decoderInput_, static_cast<uint32_t>(shape_.decoder.inputs)).columnRange(0, kFeatures);
  }

  Device& device_;
  MeshFieldShape shape_;
  bool forTraining_;
  ParameterGroup table_, encoder_, decoder_;
  uint32_t capacity_ = 0;
  Array<float> encoded_, encodedGradients_;  // [levels][Matrix::rowsOfPlane(capacity)][features]; the latter: training
  Array<float> decoderInput_;                // [capacity][features + harmonics]
  Array<float> colours_;                     // [capacity][3]
  Array<float> texelFeatures_;               // [capacity][kFeatures]
  // Only for training:
  Array<float> encoderActivations_, decoderActivations_;
  Array<float> decoderInputGradients_;  // same shape as decoderInput_
};

}  // namespace tessera

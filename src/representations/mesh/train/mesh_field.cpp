#include "representations/mesh/train/mesh_field.h"

#include "compute/encodings.h"
#include "field/initial_values.h"

namespace tessera {

MeshFieldShape makeMeshFieldShape(const HashGridOptions& grid, int encoderWidth, int encoderHidden) {
  MeshFieldShape shape{HashGrid(grid), {}, {}};
  shape.encoder.inputs = static_cast<int>(shape.grid.columns());
  shape.encoder.width = encoderWidth;
  shape.encoder.hiddenLayers = encoderHidden;
  shape.encoder.outputs = MeshField::kFeatures;
  shape.decoder.inputs = MeshField::kFeatures + shape.harmonicsDegree * shape.harmonicsDegree;
  shape.decoder.width = 16;
  shape.decoder.hiddenLayers = 2;
  shape.decoder.outputs = 3;
  shape.decoder.activation = OutputActivation::sigmoid;
  return shape;
}

MeshField::MeshField(Device& device, MeshFieldShape shape, uint64_t seed, bool forTraining)
    : device_(device),
      shape_(std::move(shape)),
      forTraining_(forTraining),
      table_(device, "table", initialTable(shape_.grid.parameters(), seed), forTraining),
      encoder_(device, "encoder", initialWeights(shape_.encoder, seed, 0xe0), forTraining),
      decoder_(device, "decoder", initialWeights(shape_.decoder, seed, 0xde), forTraining) {}

void MeshField::reserve(uint32_t samples) {
  if (samples <= capacity_) return;
  capacity_ = samples;
  const size_t n = samples, inputs = static_cast<size_t>(shape_.decoder.inputs);
  const size_t encodings = Matrix<float>::rowsOfPlane(n) * shape_.grid.columns();
  encoded_ = device_.array<float>(encodings);
  decoderInput_ = device_.array<float>(n * inputs);
  colours_ = device_.array<float>(n * 3);
  if (!forTraining_) return;
  encodedGradients_ = device_.array<float>(encodings);
  decoderInputGradients_ = device_.array<float>(n * inputs);
  texelFeatures_ = device_.array<float>(n * kFeatures);
  encoderActivations_ = device_.allocateActivations(shape_.encoder, n);
  decoderActivations_ = device_.allocateActivations(shape_.decoder, n);
}

Matrix<float> MeshField::byLevel(Array<float>& encodings) {
  return Matrix<float>::grouped(encodings, shape_.grid.columns(), static_cast<uint32_t>(shape_.grid.features),
                                Matrix<float>::rowsOfPlane(capacity_));
}

void MeshField::encode(Count samples, Slice<const float> positions, Matrix<float> features) {
  CHECK(samples.capacity <= capacity_);
  device_.run(HashGridForward{shape_.grid, samples, positions, table_.values, byLevel(encoded_)});
  device_.run(MlpForward{shape_.encoder, samples, byLevel(encoded_), encoder_.values, features, {}});
}

MeshField::Output MeshField::forward(Count samples, Slice<const float> positions, Slice<const float> directions,
                                     Slice<const uint32_t> rayOfSample, bool forBackward) {
  CHECK(samples.capacity <= capacity_);
  CHECK((forTraining_ || !forBackward));
  const auto activations = [&](Array<float>& all) { return forBackward ? all.all() : Slice<float>(); };
  device_.run(HashGridForward{shape_.grid, samples, positions, table_.values, byLevel(encoded_)});
  device_.run(MlpForward{shape_.encoder, samples, byLevel(encoded_), encoder_.values, features(),
                         activations(encoderActivations_)});
  const Matrix<float> input(decoderInput_, static_cast<uint32_t>(shape_.decoder.inputs));
  const uint32_t harmonics = static_cast<uint32_t>(shape_.harmonicsDegree * shape_.harmonicsDegree);
  device_.run(SphericalHarmonicsForward{shape_.harmonicsDegree, samples, directions, rayOfSample,
                                        input.columnRange(kFeatures, harmonics)});
  device_.run(MlpForward{shape_.decoder, samples, input, decoder_.values, Matrix<float>(colours_, 3),
                         activations(decoderActivations_)});
  return {features().columnRange(0, 1), Matrix<float>(colours_, 3)};
}

void MeshField::backward(Count samples, Slice<const float> positions, Slice<const float> logitGradients,
                         Matrix<const float> colourGradients, bool trains, Slice<float> positionGradients) {
  const auto parameterGradients = [&](ParameterGroup& group) {
    return trains ? group.gradients.all() : Slice<float>();
  };
  const uint32_t inputs = static_cast<uint32_t>(shape_.decoder.inputs);
  const Matrix<float> input(decoderInput_, inputs), inputGradients(decoderInputGradients_, inputs);
  device_.run(MlpBackward{shape_.decoder,
                          samples,
                          input,
                          decoder_.values,
                          Matrix<float>(colours_, 3),
                          decoderActivations_,
                          colourGradients,
                          {},
                          parameterGradients(decoder_),
                          inputGradients});
  const Matrix<float> encodedGradients = byLevel(encodedGradients_);
  device_.run(MlpBackward{shape_.encoder, samples, byLevel(encoded_), encoder_.values, features(), encoderActivations_,
                          inputGradients.columnRange(0, kFeatures), logitGradients, parameterGradients(encoder_),
                          encodedGradients});
  device_.run(HashGridBackward{shape_.grid, samples, positions, table_.values, encodedGradients,
                               parameterGradients(table_), positionGradients});
}

void MeshField::encodeForBackward(Count texels, Slice<const float> positions) {
  CHECK(texels.capacity <= capacity_);
  CHECK(forTraining_ == true);
  device_.run(HashGridForward{shape_.grid, texels, positions, table_.values, byLevel(encoded_)});
  device_.run(
      MlpForward{shape_.encoder, texels, byLevel(encoded_), encoder_.values, encodedFeatures(), encoderActivations_});
}

void MeshField::encodeBackward(Count texels, Slice<const float> positions, Matrix<const float> featureGradients,
                               Slice<const float> logitGradients) {
  const Matrix<float> encodedGradients = byLevel(encodedGradients_);
  device_.run(MlpBackward{shape_.encoder, texels, byLevel(encoded_), encoder_.values, encodedFeatures(),
                          encoderActivations_, featureGradients, logitGradients, encoder_.gradients, encodedGradients});
  device_.run(HashGridBackward{shape_.grid, texels, positions, table_.values, encodedGradients, table_.gradients, {}});
}

Matrix<const float> MeshField::decode(Count hits, Slice<const float> directions, Slice<const uint32_t> rayOfHit) {
  CHECK(hits.capacity <= capacity_);
  const Matrix<float> input(decoderInput_, static_cast<uint32_t>(shape_.decoder.inputs));
  const uint32_t harmonics = static_cast<uint32_t>(shape_.harmonicsDegree * shape_.harmonicsDegree);
  device_.run(SphericalHarmonicsForward{shape_.harmonicsDegree, hits, directions, rayOfHit,
                                        input.columnRange(kFeatures, harmonics)});
  device_.run(
      MlpForward{shape_.decoder, hits, input, decoder_.values, Matrix<float>(colours_, 3), decoderActivations_});
  return Matrix<float>(colours_, 3);
}

Matrix<const float> MeshField::decodeBackward(Count hits, Matrix<const float> colourGradients, bool trains) {
  const uint32_t inputs = static_cast<uint32_t>(shape_.decoder.inputs);
  const Matrix<float> inputGradients(decoderInputGradients_, inputs);
  device_.run(MlpBackward{shape_.decoder,
                          hits,
                          Matrix<float>(decoderInput_, inputs),
                          decoder_.values,
                          Matrix<float>(colours_, 3),
                          decoderActivations_,
                          colourGradients,
                          {},
                          trains ? decoder_.gradients.all() : Slice<float>(),
                          inputGradients});
  return inputGradients.columnRange(0, kFeatures);
}

}  // namespace tessera

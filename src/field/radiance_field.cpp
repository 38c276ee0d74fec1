#include "field/radiance_field.h"

#include "compute/encodings.h"
#include "field/initial_values.h"

namespace tessera {

RadianceFieldShape makeRadianceFieldShape(const HashGridOptions& grid, int width, int densityHidden, int colourHidden) {
  constexpr int kGeometryFeatures = RadianceField::kGeometryFeatures;
  RadianceFieldShape shape{HashGrid(grid), {}, {}, 4};
  shape.density.inputs = static_cast<int>(shape.grid.columns());
  shape.density.width = width;
  shape.density.hiddenLayers = densityHidden;
  shape.density.outputs = kGeometryFeatures;
  shape.colour.inputs = kGeometryFeatures + shape.harmonicsDegree * shape.harmonicsDegree;
  shape.colour.width = width;
  shape.colour.hiddenLayers = colourHidden;
  shape.colour.outputs = 3;
  shape.colour.activation = OutputActivation::sigmoid;
  return shape;
}

size_t densityMultiplyAccumulates(const RadianceFieldShape& shape) {
  return 8 * shape.grid.columns() + countMultiplyAccumulates(shape.density);
}

size_t colourMultiplyAccumulates(const RadianceFieldShape& shape) {
  return countMultiplyAccumulates(shape.colour);
}

RadianceField::RadianceField(Device& device, RadianceFieldShape shape, uint64_t seed)
    : device_(device),
      shape_(std::move(shape)),
      table_(device, "table", initialTable(shape_.grid.parameters(), seed)),
      density_(device, "density", initialWeights(shape_.density, seed, 0xde)),
      colour_(device, "colour", initialWeights(shape_.colour, seed, 0xc0)) {}

void RadianceField::reserve(uint32_t samples) {
  if (samples <= capacity_) return;
  capacity_ = samples;
  const size_t n = samples;
  for (Array<float>* encodings : {&encoded_, &encodedGradients_}) {
    *encodings = device_.array<float>(Matrix<float>::rowsOfPlane(n) * shape_.grid.columns());
  }
  colourInput_ = device_.array<float>(n * shape_.colour.inputs);
  colours_ = device_.array<float>(n * 3);
  densityActivations_ = device_.allocateActivations(shape_.density, n);
  colourActivations_ = device_.allocateActivations(shape_.colour, n);
  colourInputGradients_ = device_.array<float>(n * shape_.colour.inputs);
}

Matrix<float> RadianceField::byLevel(Array<float>& encodings) {
  return Matrix<float>::grouped(encodings, shape_.grid.columns(), static_cast<uint32_t>(shape_.grid.features),
                                Matrix<float>::rowsOfPlane(capacity_));
}

Matrix<float> RadianceField::geometry() {
  return Matrix<float>(colourInput_, shape_.colour.inputs).columnRange(0, kGeometryFeatures);
}

void RadianceField::density(Count samples, Slice<const float> positions, Matrix<float> geometry) {
  CHECK(samples.capacity <= capacity_);
  device_.run(HashGridForward{shape_.grid, samples, positions, table_.values, byLevel(encoded_)});
  device_.run(MlpForward{shape_.density, samples, byLevel(encoded_), density_.values, geometry, {}});
}

RadianceField::Output RadianceField::forward(Count samples, Slice<const float> positions, Slice<const float> directions,
                                             Slice<const uint32_t> rayOfSample, bool forBackward) {
  CHECK(samples.capacity <= capacity_);
  device_.run(HashGridForward{shape_.grid, samples, positions, table_.values, byLevel(encoded_)});
  device_.run(MlpForward{shape_.density, samples, byLevel(encoded_), density_.values, geometry(),
                         forBackward ? densityActivations_.all() : Slice<float>()});
  return colour(samples, directions, rayOfSample, forBackward ? colourActivations_.all() : Slice<float>());
}

RadianceField::Output RadianceField::colour(Count samples, Slice<const float> directions,
                                            Slice<const uint32_t> rayOfSample) {
  return colour(samples, directions, rayOfSample, {});
}

RadianceField::Output RadianceField::colour(Count samples, Slice<const float> directions,
                                            Slice<const uint32_t> rayOfSample, Slice<float> activations) {
  CHECK(samples.capacity <= capacity_);
  const Matrix<float> input(colourInput_, shape_.colour.inputs);
  const uint32_t harmonics = shape_.harmonicsDegree * shape_.harmonicsDegree;
  device_.run(SphericalHarmonicsForward{shape_.harmonicsDegree, samples, directions, rayOfSample,
                                        input.columnRange(kGeometryFeatures, harmonics)});
  device_.run(MlpForward{shape_.colour, samples, input, colour_.values, Matrix<float>(colours_, 3), activations});
  return {geometry().columnRange(0, 1), Matrix<float>(colours_, 3)};
}

void RadianceField::backward(Count samples, Slice<const float> positions, Slice<const float> logDensityGradients,
                             Matrix<const float> colourGradients) {
  const Matrix<float> input(colourInput_, shape_.colour.inputs);
  const Matrix<float> inputGradients(colourInputGradients_, shape_.colour.inputs);
  device_.run(MlpBackward{shape_.colour,
                          samples,
                          input,
                          colour_.values,
                          Matrix<float>(colours_, 3),
                          colourActivations_,
                          colourGradients,
                          {},
                          colour_.gradients,
                          inputGradients});
  const Matrix<float> encodedGradients = byLevel(encodedGradients_);
  device_.run(MlpBackward{shape_.density, samples, byLevel(encoded_), density_.values,
                          input.columnRange(0, kGeometryFeatures), densityActivations_,
                          inputGradients.columnRange(0, kGeometryFeatures), logDensityGradients, density_.gradients,
                          encodedGradients});
  device_.run(HashGridBackward{shape_.grid, samples, positions, table_.values, encodedGradients, table_.gradients, {}});
}

}  // namespace tessera

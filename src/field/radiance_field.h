// The radiance field of Instant-NGP (Müller et al. 2022, section 5.4): a hash grid, a density network whose first
// output is the logarithm of density, and a colour network whose inputs are all outputs of the density network and the
// view direction in spherical harmonics.
#pragma once

#include "compute/hash_grid.h"
#include "compute/mlp.h"
#include "field/parameters.h"

namespace tessera {

struct RadianceFieldShape {
  HashGrid grid;
  MlpShape density;  // grid columns → geometry features; output 0 is log density
  MlpShape colour;   // geometry features + harmonics → 3, sigmoid
  int harmonicsDegree = 4;
};

// Returns the multiply-accumulate operations of the density of one sample: interpolation in the hash grid, and network.
size_t densityMultiplyAccumulates(const RadianceFieldShape& shape);
// Returns those of its colour: the view-dependent network.
size_t colourMultiplyAccumulates(const RadianceFieldShape& shape);

RadianceFieldShape makeRadianceFieldShape(const HashGridOptions& grid, int width, int densityHidden, int colourHidden);

class RadianceField {
 public:
  static constexpr int kGeometryFeatures = 16;  // outputs of the density network

  // Initialises the table to U(±1e-4) and the networks to Xavier uniform on padded sizes, as a function of `seed`
  // alone. Keeps a reference to `device`.
  RadianceField(Device& device, RadianceFieldShape shape, uint64_t seed);

  // Allocates memory for this many samples in the calls below.
  void reserve(uint32_t samples);
  uint32_t capacity() const { return capacity_; }

  // Evaluates the density network alone, without activations for backward. positions: [capacity][3] in [0,1];
  // `geometry`: receives the network's first outputs, as many as it has columns; the first is the log density.
  void density(Count samples, Slice<const float> positions, Matrix<float> geometry);

  struct Output {
    Matrix<const float> logDensity;  // 1 column
    Matrix<const float> colours;     // 3 columns
  };
  // Evaluates both networks; `forBackward` stores the activations. directions: [rays][3]; rayOfSample: [capacity].
  // The output is valid until the next call.
  Output forward(Count samples, Slice<const float> positions, Slice<const float> directions,
                 Slice<const uint32_t> rayOfSample, bool forBackward);

  // Evaluates the colour network alone, of samples whose outputs of the density network are in geometry().
  Output colour(Count samples, Slice<const float> directions, Slice<const uint32_t> rayOfSample);
  Matrix<float> geometry();  // [capacity][kGeometryFeatures], a part of wider rows

  // Call it after `forward` with the same samples. Adds to the gradients of the parameter groups.
  void backward(Count samples, Slice<const float> positions, Slice<const float> logDensityGradients,
                Matrix<const float> colourGradients);

  ParameterGroup& table() { return table_; }
  ParameterGroup& densityNetwork() { return density_; }
  ParameterGroup& colourNetwork() { return colour_; }
  const RadianceFieldShape& shape() const { return shape_; }

 private:
  Matrix<float> byLevel(Array<float>& encodings);
  Output colour(Count samples, Slice<const float> directions, Slice<const uint32_t> rayOfSample,
                Slice<float> activations);

  Device& device_;
  RadianceFieldShape shape_;
  ParameterGroup table_, density_, colour_;
  uint32_t capacity_ = 0;
  Array<float> encoded_, encodedGradients_;  // [levels][Matrix::rowsOfPlane(capacity)][features]
  Array<float> colourInput_;                 // [capacity][geometry features + harmonics]
  Array<float> colours_;                     // [capacity][3]
  Array<float> densityActivations_, colourActivations_;
  Array<float> colourInputGradients_;  // same shape as colourInput_
};

}  // namespace tessera

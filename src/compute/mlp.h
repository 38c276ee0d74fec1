// Small fully connected networks without biases, like the fully fused MLP of tiny-cuda-nn: ReLU between layers, and
// sizes padded to multiples of 16. Padding inputs read as zero. Widths are 16 to 128.
#pragma once

#include "compute/memory.h"
#include "compute/operation.h"

namespace tessera {

enum class OutputActivation { none, sigmoid };

struct MlpShape {
  int inputs = 32;
  int width = 64;        // 16, 32, 64 or 128
  int hiddenLayers = 1;  // at least 1
  int outputs = 16;
  OutputActivation activation = OutputActivation::none;

  static int padded(int size) { return (size + 15) / 16 * 16; }
  int layers() const { return hiddenLayers + 1; }
  int layerInputs(int layer) const { return layer == 0 ? padded(inputs) : width; }
  int layerOutputs(int layer) const { return layer == hiddenLayers ? padded(outputs) : width; }
  // The weights of layer l begin at weightOffset(l), as [layerOutputs][layerInputs], row-major.
  size_t weightOffset(int layer) const {
    size_t offset = 0;
    for (int l = 0; l < layer; ++l) offset += static_cast<size_t>(layerInputs(l)) * layerOutputs(l);
    return offset;
  }
  size_t parameters() const { return weightOffset(layers()); }
  size_t activationsPerSample() const { return static_cast<size_t>(width) * hiddenLayers; }
};

// The multiply-accumulates of a forward pass for one sample, without the padding.
inline size_t countMultiplyAccumulates(const MlpShape& shape) {
  const size_t width = static_cast<size_t>(shape.width);
  return width * (static_cast<size_t>(shape.inputs) + static_cast<size_t>(shape.outputs)) +
         width * width * static_cast<size_t>(shape.hiddenLayers - 1);
}

// MlpForward and MlpBackward can work on part of the rows (Count::first). Activations are
// [hiddenLayers][capacity][width], after ReLU, as fp16 or float according to Device::storesActivationsInHalf; they and
// the weights begin at a multiple of 16 bytes.
struct MlpForward {
  const MlpShape& shape;
  Count samples;
  Matrix<const float> input;   // [capacity][inputs]
  Slice<const float> weights;  // [shape.parameters()]
  Matrix<float> output;        // [capacity][outputs], row-major; with fewer columns, only the first outputs are written
  Slice<float> activations;    // optional, Device::allocateActivations(shape, capacity): stored for MlpBackward
};
TESSERA_OPERATION(MlpForward);

// Adds to `weightGradients`; overwrites `inputGradients`. At least one of them is given: without weight gradients, a
// network that other samples train can be passed through.
struct MlpBackward {
  const MlpShape& shape;
  Count samples;
  Matrix<const float> input;
  Slice<const float> weights;
  Matrix<const float> output;               // read only if the gradient of the output activation needs it
  Slice<const float> activations;           // from MlpForward
  Matrix<const float> outputGradients;      // [capacity][outputs], row-major; with respect to the activated output
  Slice<const float> firstOutputGradients;  // optional, [capacity]: added to the gradient of output 0 (a density that
                                            // compositing and a colour network both use)
  Slice<float> weightGradients;             // optional, [shape.parameters()]
  Matrix<float> inputGradients;             // optional, [capacity][inputs]
};
TESSERA_OPERATION(MlpBackward);

}  // namespace tessera

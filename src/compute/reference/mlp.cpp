#include "compute/mlp.h"

#include <cmath>

#include "compute/reference/convert.h"
#include "compute/reference/functions.h"

namespace tessera::reference {
namespace {

// Element i of the input of layer `l` for one sample: of the input padded with zeros, or of the hidden layer before it.
double layerInput(const MlpShape& shape, int l, size_t samples, size_t s, int i, View input, View activations) {
  if (l == 0) return i < shape.inputs ? input[s * shape.inputs + i] : 0;
  return activations[(static_cast<size_t>(l - 1) * samples + s) * shape.width + i];
}

}  // namespace

MlpResult mlpForward(const MlpShape& shape, size_t samples, View input, View weights) {
  MlpResult result{Doubles(samples * shape.outputs), Doubles(samples * shape.activationsPerSample())};
  for (int l = 0; l < shape.layers(); ++l) {
    const bool last = l == shape.hiddenLayers;
    const int ins = shape.layerInputs(l), outs = last ? shape.outputs : shape.width;
    const double* matrix = weights.data() + shape.weightOffset(l);
    for (size_t s = 0; s < samples; ++s)
      for (int o = 0; o < outs; ++o) {
        double sum = 0;
        for (int i = 0; i < ins; ++i)
          sum +=
              matrix[static_cast<size_t>(o) * ins + i] * layerInput(shape, l, samples, s, i, input, result.activations);
        if (!last)
          result.activations[(static_cast<size_t>(l) * samples + s) * shape.width + o] = sum > 0 ? sum : 0;
        else
          result.output[s * shape.outputs + o] =
              shape.activation == OutputActivation::sigmoid ? 1 / (1 + std::exp(-sum)) : sum;
      }
  }
  return result;
}

MlpGradients mlpBackward(const MlpShape& shape, size_t samples, View input, View weights, View output, View activations,
                         View outputGradients) {
  MlpGradients gradients{Doubles(shape.parameters()), Doubles(samples * shape.inputs)};
  for (size_t s = 0; s < samples; ++s) {
    Doubles upstream(outputGradients.begin() + s * shape.outputs, outputGradients.begin() + (s + 1) * shape.outputs);
    if (shape.activation == OutputActivation::sigmoid)
      for (int o = 0; o < shape.outputs; ++o) {
        const double y = output[s * shape.outputs + o];
        upstream[o] *= y * (1 - y);
      }
    for (int l = shape.hiddenLayers; l >= 0; --l) {
      const int ins = shape.layerInputs(l);
      const size_t offset = shape.weightOffset(l);
      Doubles below(ins);
      for (size_t o = 0; o < upstream.size(); ++o)
        for (int i = 0; i < ins; ++i) {
          gradients.weights[offset + o * ins + i] +=
              upstream[o] * layerInput(shape, l, samples, s, i, input, activations);
          below[i] += upstream[o] * weights[offset + o * ins + i];
        }
      if (l == 0)
        for (int i = 0; i < shape.inputs; ++i) gradients.input[s * shape.inputs + i] = below[i];
      else
        for (int i = 0; i < ins; ++i)
          if (!(layerInput(shape, l, samples, s, i, input, activations) > 0)) below[i] = 0;
      upstream = below;
    }
  }
  return gradients;
}

void run(const MlpForward& a) {
  const HostRows rows = hostRows(a.samples);
  const size_t samples = rows.count(), width = a.shape.width;
  CHECK(a.input.columns == static_cast<uint32_t>(a.shape.inputs));
  CHECK(a.output.columns <= static_cast<uint32_t>(a.shape.outputs));
  const MlpResult result = mlpForward(a.shape, samples, doubles(a.input.rowsFrom(rows.begin), samples),
                                      doubles(a.weights, a.shape.parameters()));
  Doubles firstColumns;
  for (size_t s = 0; s < samples; ++s) {
    const auto row = result.output.begin() + static_cast<ptrdiff_t>(s * a.shape.outputs);
    firstColumns.insert(firstColumns.end(), row, row + a.output.columns);
  }
  store(a.output.rowsFrom(rows.begin), firstColumns);
  for (size_t l = 0; a.activations && l < static_cast<size_t>(a.shape.hiddenLayers); ++l)
    store(a.activations.part((l * a.samples.capacity + rows.begin) * width, samples * width),
          View(result.activations).subspan(l * samples * width, samples * width));
}

void run(const MlpBackward& a) {
  const HostRows rows = hostRows(a.samples);
  const size_t samples = rows.count(), width = a.shape.width;
  Doubles activations;
  for (size_t l = 0; l < static_cast<size_t>(a.shape.hiddenLayers); ++l) {
    const size_t first = (l * a.samples.capacity + rows.begin) * width;
    const Doubles layer = doubles(a.activations.part(first, samples * width), samples * width);
    activations.insert(activations.end(), layer.begin(), layer.end());
  }
  Doubles outputGradients = doubles(a.outputGradients.rowsFrom(rows.begin), samples);
  const Doubles first = doublesOfRows(a.firstOutputGradients, 1, rows);
  for (size_t s = 0; s < first.size(); ++s) outputGradients[s * a.shape.outputs] += first[s];
  const Doubles output =
      a.shape.activation == OutputActivation::none ? Doubles() : doubles(a.output.rowsFrom(rows.begin), samples);
  const MlpGradients gradients =
      mlpBackward(a.shape, samples, doubles(a.input.rowsFrom(rows.begin), samples),
                  doubles(a.weights, a.shape.parameters()), output, activations, outputGradients);
  if (a.weightGradients) add(a.weightGradients, gradients.weights);
  if (a.inputGradients) store(a.inputGradients.rowsFrom(rows.begin), gradients.input);
}

}  // namespace tessera::reference

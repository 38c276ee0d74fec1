// Test cases of the fully connected networks.
#include <fmt/format.h>

#include <cmath>

#include "compute/device_test.h"
#include "compute/mlp.h"

namespace tessera::device_test {
namespace {

struct NetworkCase {
  MlpShape shape;
  Layout input = Layout::plain;
  Layout output = Layout::plain;
  std::string name() const {
    static constexpr const char* kLayouts[] = {"plain", "strided", "grouped"};
    return fmt::format("{}-{}x{}-{}{}, input {}, output {}", shape.inputs, shape.width, shape.hiddenLayers,
                       shape.outputs, shape.activation == OutputActivation::sigmoid ? " sigmoid" : "",
                       kLayouts[static_cast<int>(input)], kLayouts[static_cast<int>(output)]);
  }
};

std::vector<NetworkCase> networks() {
  constexpr OutputActivation none = OutputActivation::none, sigmoid = OutputActivation::sigmoid;
  return {
      {{32, 64, 1, 16, none}, Layout::grouped, Layout::plain},
      {{31, 64, 2, 3, sigmoid}, Layout::strided, Layout::plain},
      {{3, 16, 1, 1, none}, Layout::plain, Layout::plain},
      {{18, 16, 3, 5, sigmoid}, Layout::grouped, Layout::strided},
      {{20, 32, 2, 17, none}, Layout::strided, Layout::strided},
      {{48, 128, 2, 16, none}, Layout::plain, Layout::plain},
  };
}

std::vector<float> randomWeights(Random& random, const MlpShape& shape) {
  std::vector<float> weights;
  for (int l = 0; l < shape.layers(); ++l) {
    const int ins = shape.layerInputs(l), outs = shape.layerOutputs(l);
    const float bound = std::sqrt(6.0f / static_cast<float>(ins + outs));
    const std::vector<float> layer = random.floats(static_cast<size_t>(ins) * outs, -bound, bound);
    weights.insert(weights.end(), layer.begin(), layer.end());
  }
  return weights;
}

// Random inputs, weights, outputs and activations, like those of a forward pass over all `capacity` samples.
struct Network {
  std::vector<float> input, weights, output, activations;

  Network(Random& random, const MlpShape& shape, size_t samples)
      : input(random.floats(samples * shape.inputs, -1, 1)), weights(randomWeights(random, shape)) {
    const reference::MlpResult result = reference::mlpForward(shape, samples, toDoubles(input), toDoubles(weights));
    output = toFloats(result.output);
    activations = toFloats(result.activations);
  }
};

}  // namespace

template <>
OperationTests makeTests<MlpForward>() {
  OperationTests tests;
  tests.noGradient = "its gradient is MlpBackward";
  tests.inHalves = true;
  for (const NetworkCase& network : networks())
    for (const Size& size : kRowSizes)
      for (bool keep : {false, true})
        tests.cases.push_back(
            {fmt::format("{}, samples {}{}", network.name(), toString(size),
                         keep ? ", activations kept" : ", half of the outputs"),
             [=](Stage& stage) {
               const MlpShape& shape = network.shape;
               const uint32_t outputs = keep ? shape.outputs : (shape.outputs + 1) / 2;
               stage.device.run(MlpForward{
                   shape, stage.count(size), stage.randomMatrix(size.capacity, shape.inputs, network.input, -1, 1),
                   stage.input(randomWeights(stage.random, shape)),
                   stage.outputMatrix("output", size.capacity, outputs, network.output),
                   keep ? stage.keptOutput("activations", size.capacity * shape.activationsPerSample())
                        : Slice<float>()});
             }});
  tests.cases.push_back(
      {"sigmoids far from zero", [](Stage& stage) {
         // Every layer takes means of the inputs; the last one changes the sign of every other.
         const MlpShape shape = networks()[1].shape;
         constexpr size_t kSamples = 200;
         std::vector<float> weights;
         for (int l = 0; l < shape.layers(); ++l)
           for (int o = 0; o < shape.layerOutputs(l); ++o)
             weights.insert(
                 weights.end(), static_cast<size_t>(shape.layerInputs(l)),
                 (l == shape.hiddenLayers && o % 2 == 0 ? -1.0f : 1.0f) / static_cast<float>(shape.layerInputs(l)));
         stage.device.run(
             MlpForward{shape, Count{kSamples, {}},
                        stage.randomMatrix(kSamples, shape.inputs, Layout::strided, 100, 2000), stage.input(weights),
                        stage.outputMatrix("output", kSamples, shape.outputs, Layout::plain), Slice<float>()});
       }});
  return tests;
}

template <>
OperationTests makeTests<MlpBackward>() {
  OperationTests tests;
  tests.inHalves = true;
  for (const NetworkCase& network : networks())
    for (const Size& size : kRowSizes)
      for (int optional = 0; optional < 5; ++optional) {
        const bool withFirst = optional & 1, onlyInput = optional == 4, withInput = onlyInput || optional & 2;
        tests.cases.push_back(
            {fmt::format("{}, samples {}{}{}{}", network.name(), toString(size), withFirst ? ", first output" : "",
                         withInput ? ", input gradients" : "", onlyInput ? " only" : ""),
             [=](Stage& stage) {
               const MlpShape& shape = network.shape;
               const Network saved(stage.random, shape, size.capacity);
               stage.device.run(MlpBackward{
                   shape, stage.count(size), stage.makeMatrix(saved.input, shape.inputs, network.input),
                   stage.input(saved.weights), stage.makeMatrix(saved.output, shape.outputs, network.output),
                   stage.keptInput(saved.activations),
                   stage.randomMatrix(size.capacity, shape.outputs, network.output, -1, 1),
                   withFirst ? stage.randomInput(size.capacity, -1, 1) : Slice<float>(),
                   onlyInput ? Slice<float>()
                             : stage.output("weightGradients", stage.random.floats(shape.parameters(), -1, 1)),
                   withInput ? stage.outputMatrix("inputGradients", size.capacity, shape.inputs, network.input)
                             : Matrix<float>()});
             }});
      }
  for (const NetworkCase& network : networks())
    tests.gradients.push_back(
        {network.name(), [=](Stage& stage) {
           const MlpShape& shape = network.shape;
           const uint32_t samples = 6;
           const Network saved(stage.random, shape, samples);
           const std::vector<float> upstream = stage.random.floats(samples * shape.outputs, -1, 1);
           const std::vector<float> first = stage.random.floats(samples, -1, 1);
           const Slice<float> weightGradients = stage.input(std::vector<float>(shape.parameters()));
           const Matrix<float> inputGradients =
               stage.outputMatrix("inputGradients", samples, shape.inputs, Layout::plain);
           stage.device.run(MlpBackward{
               shape, Count{samples, {}}, stage.makeMatrix(saved.input, shape.inputs, network.input),
               stage.input(saved.weights), stage.makeMatrix(saved.output, shape.outputs, network.output),
               stage.keptInput(saved.activations), stage.makeMatrix(upstream, shape.outputs, network.output),
               stage.input(first), weightGradients, inputGradients});
           const auto loss = [&](View input, View weights) {
             const reference::MlpResult result = reference::mlpForward(shape, samples, input, weights);
             double sum = dot(result.output, toDoubles(upstream));
             for (uint32_t s = 0; s < samples; ++s) sum += first[s] * result.output[s * shape.outputs];
             return sum;
           };
           const Doubles x = toDoubles(saved.input), w = toDoubles(saved.weights);
           const std::vector<uint32_t> some = stage.random.wordsBelow(60, static_cast<uint32_t>(shape.parameters()));
           // The step is small enough that no ReLU changes its state.
           return std::vector<GradientPair>{
               {"weights", pick(stage.device.read(weightGradients), some),
                centralDifferences([&](View moved) { return loss(x, moved); }, w, 1e-7, some)},
               {"input", stage.device.read(inputGradients.data),
                centralDifferences([&](View moved) { return loss(moved, w); }, x, 1e-7, firstIndices(x.size()))}};
         }});
  return tests;
}

}  // namespace tessera::device_test

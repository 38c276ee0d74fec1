#include "render/cpu/dense_network.h"

#include <cmath>
#include <cstring>

#include "base/check.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "render/cpu/dense_network.cpp"
#include <hwy/foreach_target.h>
// after foreach_target
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace tessera::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

HWY_ATTR void evaluateLayers(const std::vector<DenseNetwork::Layer>& layers, float* values) {
  const hn::CappedTag<float, 8> d;
  const size_t lanes = hn::Lanes(d);
  alignas(64) float outputs[DenseNetwork::kMostWidth];
  for (size_t number = 0; number < layers.size(); ++number) {
    const DenseNetwork::Layer& layer = layers[number];
    const auto least = hn::Set(d, number + 1 < layers.size() ? 0.0f : -INFINITY);
    for (size_t o = 0; o < layer.outputs; o += lanes) {
      const float* weights = layer.weights.data() + o;
      auto even = hn::LoadU(d, layer.biases.data() + o), odd = hn::Zero(d);
      size_t i = 0;
      for (; i + 1 < layer.inputs; i += 2, weights += 2 * layer.outputs) {
        even = hn::MulAdd(hn::Set(d, values[i]), hn::LoadU(d, weights), even);
        odd = hn::MulAdd(hn::Set(d, values[i + 1]), hn::LoadU(d, weights + layer.outputs), odd);
      }
      if (i < layer.inputs) even = hn::MulAdd(hn::Set(d, values[i]), hn::LoadU(d, weights), even);
      hn::StoreU(hn::Max(hn::Add(even, odd), least), d, outputs + o);
    }
    std::memcpy(values, outputs, layer.outputs * sizeof(float));
  }
}

}  // namespace tessera::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace tessera {

HWY_EXPORT(evaluateLayers);

DenseNetwork::DenseNetwork(const std::vector<DenseLayer>& network, uint32_t inputs, uint32_t outputs) {
  CHECK(network.empty() == false);
  CHECK(network.front().inputs == inputs);
  CHECK(network.back().outputs == outputs);
  uint32_t width = inputs;
  for (const DenseLayer& layer : network) {
    CHECK(layer.inputs == width);
    CHECK(layer.outputs <= kMostWidth);
    CHECK(layer.weights.size() == size_t{layer.inputs} * layer.outputs);
    CHECK(layer.biases.size() == layer.outputs);
    width = layer.outputs;
    Layer laid{layer.inputs, (layer.outputs + 7) / 8 * 8, {}, layer.biases};
    laid.biases.resize(laid.outputs);
    laid.weights.resize(size_t{laid.inputs} * laid.outputs);
    for (uint32_t o = 0; o < layer.outputs; ++o) {
      for (uint32_t i = 0; i < layer.inputs; ++i) {
        laid.weights[size_t{i} * laid.outputs + o] = layer.weights[size_t{o} * layer.inputs + i];
      }
    }
    layers_.push_back(std::move(laid));
  }
}

void DenseNetwork::run(float* values) const {
  HWY_DYNAMIC_DISPATCH(evaluateLayers)(layers_, values);
}

}  // namespace tessera
#endif

#include "render/cpu/dense_network.h"

#include <cmath>
#include <cstring>

#include "base/check.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "render/cpu/dense_network.cpp"
#include <hwy/foreach_target.h>
// must follow foreach_target.h
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace tessera::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

HWY_ATTR void evaluateLayers(const std::vector<DenseNetwork::Layer>& layers, float* values) {
  const hn::CappedTag<float, 8> d;
  const size_t lanes = hn::Lanes(d);
  alignas(64) float outputs[DenseNetwork::kMaxWidth];
  for (size_t number = 0; number < layers.size(); ++number) {
    const DenseNetwork::Layer& layer = layers[number];
    const auto minimum = hn::Set(d, number + 1 < layers.size() ? 0.0f : -INFINITY);
    for (size_t o = 0; o < layer.outputs; o += lanes) {
      const float* weights = layer.weights.data() + o;
      auto even = hn::LoadU(d, layer.biases.data() + o), odd = hn::Zero(d);
      size_t i = 0;
      for (; i + 1 < layer.inputs; i += 2, weights += 2 * layer.outputs) {
        even = hn::MulAdd(hn::Set(d, values[i]), hn::LoadU(d, weights), even);
        odd = hn::MulAdd(hn::Set(d, values[i + 1]), hn::LoadU(d, weights + layer.outputs), odd);
      }
      if (i < layer.inputs) even = hn::MulAdd(hn::Set(d, values[i]), hn::LoadU(d, weights), even);
      hn::StoreU(hn::Max(hn::Add(even, odd), minimum), d, outputs + o);
    }
    std::memcpy(values, outputs, layer.outputs * sizeof(float));
  }
}

HWY_ATTR void evaluatePacket(const std::vector<DenseNetwork::Layer>& layers, float* values) {
  constexpr size_t kPacket = DenseNetwork::kPacket, kOutputs = 8;  // outputs are padded to a multiple of kOutputs
  const hn::CappedTag<float, kPacket> d;
  const size_t lanes = hn::Lanes(d);
  alignas(64) float outputs[DenseNetwork::kMaxWidth * kPacket];
  for (size_t number = 0; number < layers.size(); ++number) {
    const DenseNetwork::Layer& layer = layers[number];
    const auto minimum = hn::Set(d, number + 1 < layers.size() ? 0.0f : -INFINITY);
    for (size_t o = 0; o < layer.outputs; o += kOutputs) {
      for (size_t column = 0; column < kPacket; column += lanes) {
        const float *weights = layer.weights.data() + o, *biases = layer.biases.data() + o;
        auto s0 = hn::Set(d, biases[0]), s1 = hn::Set(d, biases[1]), s2 = hn::Set(d, biases[2]),
             s3 = hn::Set(d, biases[3]), s4 = hn::Set(d, biases[4]), s5 = hn::Set(d, biases[5]),
             s6 = hn::Set(d, biases[6]), s7 = hn::Set(d, biases[7]);
        for (size_t i = 0; i < layer.inputs; ++i, weights += layer.outputs) {
          const auto x = hn::Load(d, values + i * kPacket + column);
          s0 = hn::MulAdd(hn::Set(d, weights[0]), x, s0);
          s1 = hn::MulAdd(hn::Set(d, weights[1]), x, s1);
          s2 = hn::MulAdd(hn::Set(d, weights[2]), x, s2);
          s3 = hn::MulAdd(hn::Set(d, weights[3]), x, s3);
          s4 = hn::MulAdd(hn::Set(d, weights[4]), x, s4);
          s5 = hn::MulAdd(hn::Set(d, weights[5]), x, s5);
          s6 = hn::MulAdd(hn::Set(d, weights[6]), x, s6);
          s7 = hn::MulAdd(hn::Set(d, weights[7]), x, s7);
        }
        float* to = outputs + o * kPacket + column;
        hn::Store(hn::Max(s0, minimum), d, to);
        hn::Store(hn::Max(s1, minimum), d, to + kPacket);
        hn::Store(hn::Max(s2, minimum), d, to + 2 * kPacket);
        hn::Store(hn::Max(s3, minimum), d, to + 3 * kPacket);
        hn::Store(hn::Max(s4, minimum), d, to + 4 * kPacket);
        hn::Store(hn::Max(s5, minimum), d, to + 5 * kPacket);
        hn::Store(hn::Max(s6, minimum), d, to + 6 * kPacket);
        hn::Store(hn::Max(s7, minimum), d, to + 7 * kPacket);
      }
    }
    std::memcpy(values, outputs, layer.outputs * kPacket * sizeof(float));
  }
}

}  // namespace tessera::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace tessera {

HWY_EXPORT(evaluateLayers);
HWY_EXPORT(evaluatePacket);

DenseNetwork::DenseNetwork(const std::vector<DenseLayer>& network, uint32_t inputs, uint32_t outputs) {
  CHECK(network.empty() == false);
  CHECK(network.front().inputs == inputs);
  CHECK(network.back().outputs == outputs);
  uint32_t width = inputs;
  for (const DenseLayer& layer : network) {
    CHECK(layer.inputs == width);
    CHECK(layer.outputs <= kMaxWidth);
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

uint64_t DenseNetwork::memoryBytes() const {
  uint64_t bytes = sizeof(DenseNetwork);
  for (const Layer& layer : layers_)
    bytes += sizeof(Layer) + sizeof(float) * (layer.weights.capacity() + layer.biases.capacity());
  return bytes;
}

void DenseNetwork::run(float* values) const {
  HWY_DYNAMIC_DISPATCH(evaluateLayers)(layers_, values);
}

void DenseNetwork::runPacket(float* values) const {
  HWY_DYNAMIC_DISPATCH(evaluatePacket)(layers_, values);
}

}  // namespace tessera
#endif

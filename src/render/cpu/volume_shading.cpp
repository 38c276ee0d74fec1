#include "render/cpu/volume_shading.h"

#include <cmath>
#include <cstring>

#include "base/check.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "render/cpu/volume_shading.cpp"
#include <hwy/foreach_target.h>
// after foreach_target
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace tessera::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// Overwrites `values`, which holds the inputs, with the outputs before the sigmoid.
HWY_ATTR void evaluateLayers(const std::vector<DeferredShader::Layer>& layers, float* values) {
  const hn::CappedTag<float, 8> d;
  const size_t lanes = hn::Lanes(d);
  alignas(64) float outputs[DeferredShader::kMostWidth];
  for (size_t number = 0; number < layers.size(); ++number) {
    const DeferredShader::Layer& layer = layers[number];
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

std::array<float, 27> encodeDirection(const Vec3d& direction) {
  std::array<float, 27> encoded;
  for (int c = 0; c < 3; ++c) {
    encoded[c] = static_cast<float>(direction[c]);
    double sine = std::sin(direction[c]), cosine = std::cos(direction[c]);
    for (int k = 0; k < 4; ++k) {
      encoded[3 + 3 * k + c] = static_cast<float>(sine);
      encoded[15 + 3 * k + c] = static_cast<float>(cosine);
      const double twice = 2 * sine * cosine;
      cosine = 1 - 2 * sine * sine;
      sine = twice;
    }
  }
  return encoded;
}

DeferredShader::DeferredShader(const std::vector<DenseLayer>& network) {
  CHECK(network.empty() == false);
  CHECK(network.front().inputs == kInputs);
  CHECK(network.back().outputs == kOutputs);
  uint32_t width = kInputs;
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

std::array<float, 3> DeferredShader::shade(const ContentComposite& composite,
                                           const std::array<float, 27>& direction) const {
  alignas(64) float values[kMostWidth];
  std::copy(composite.values, composite.values + ContentComposite::kValues, values);
  std::copy(direction.begin(), direction.end(), values + ContentComposite::kValues);
  HWY_DYNAMIC_DISPATCH(evaluateLayers)(layers_, values);
  std::array<float, 3> colour;
  for (int c = 0; c < 3; ++c) colour[c] = 1 / (1 + std::exp(-values[c]));
  return colour;
}

void BlendedRay::add(const ContentComposite& composite, const DeferredShader& shader,
                     const std::array<float, 27>& direction) {
  const float opacity = 1 - composite.transmittance;
  if (opacity <= 0) return;
  const std::array<float, 3> specular = shader.shade(composite, direction);
  for (int c = 0; c < 3; ++c) colour[c] += transmittance * (composite.values[c] + opacity * specular[c]);
  depth += transmittance * composite.depth;
  transmittance *= composite.transmittance;
}

}  // namespace tessera
#endif

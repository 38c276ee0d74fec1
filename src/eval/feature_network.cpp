#include "eval/feature_network.h"

#include <algorithm>
#include <limits>

#include "base/check.h"
#include "base/error.h"

namespace tessera {
namespace {

// The size of the unrolled input of one task, which should fit into the second-level cache.
constexpr size_t kPanelFloats = size_t{1} << 17;

Convolution loadConvolution(const Safetensors& file, const fs::path& path, const std::string& name, int inputs,
                            int stride, int padding) {
  const TensorView& weights = file.require(path, name + ".weight", TensorType::f32);
  const TensorView& bias = file.require(path, name + ".bias", TensorType::f32);
  const auto& shape = weights.shape;
  if (shape.size() != 4 || shape[1] != inputs || shape[2] != shape[3] || shape[2] < 1 || shape[2] > 11 ||
      shape[0] < 1 || shape[0] > 4096 || bias.shape != std::vector<int64_t>{shape[0]}) {
    throw Error(path.string(), name, "the tensor does not have the shape that this network needs",
                "use LPIPS v0.1 weights with torchvision's layers");
  }
  Convolution layer{inputs, static_cast<int>(shape[0]), static_cast<int>(shape[2]), stride, padding, {}, {}};
  const auto values = weights.as<float>();
  const int area = layer.kernel * layer.kernel;
  layer.weights.resize(layer.outputs, static_cast<Eigen::Index>(inputs) * area);
  for (int o = 0; o < layer.outputs; ++o) {
    for (int i = 0; i < inputs; ++i) {
      for (int k = 0; k < area; ++k) {
        layer.weights(o, k * inputs + i) = values[(static_cast<size_t>(o) * inputs + i) * area + k];
      }
    }
  }
  layer.bias = Eigen::Map<const Eigen::VectorXf>(bias.as<float>().data(), layer.outputs);
  return layer;
}

// Concatenates the channels of two maps of the same size.
FeatureMap joined(const FeatureMap& a, const FeatureMap& b) {
  FeatureMap result(a.width, a.height, a.channels + b.channels);
  float* target = result.values.data();
  for (size_t p = 0; p < result.positions(); ++p) {
    target = std::copy_n(a.values.data() + p * a.channels, a.channels, target);
    target = std::copy_n(b.values.data() + p * b.channels, b.channels, target);
  }
  return result;
}

}  // namespace

FeatureMap Convolution::operator()(const FeatureMap& input, ThreadPool& pool) const {
  CHECK(input.channels == inputs);
  const int width = (input.width + 2 * padding - kernel) / stride + 1;
  const int height = (input.height + 2 * padding - kernel) / stride + 1;
  CHECK(width >= 1);
  CHECK(height >= 1);
  FeatureMap output(width, height, outputs);
  const auto patch = static_cast<size_t>(weights.cols());
  const size_t grain = std::clamp<size_t>(kPanelFloats / patch, 16, 4096);
  pool.forRanges(output.positions(), grain, [&](size_t begin, size_t end) {
    // Each column is the window under one output position, so that the convolution is one matrix product.
    Eigen::MatrixXf panel(static_cast<Eigen::Index>(patch), static_cast<Eigen::Index>(end - begin));
    for (size_t p = begin; p < end; ++p) {
      float* column = panel.data() + (p - begin) * patch;
      const int left = static_cast<int>(p % width) * stride - padding,
                top = static_cast<int>(p / width) * stride - padding;
      for (int ky = 0; ky < kernel; ++ky) {
        for (int kx = 0; kx < kernel; ++kx, column += inputs) {
          const int x = left + kx, y = top + ky;
          if (x < 0 || y < 0 || x >= input.width || y >= input.height) {
            std::fill_n(column, inputs, 0.0f);
          } else {
            std::copy_n(input.values.data() + (static_cast<size_t>(y) * input.width + x) * inputs, inputs, column);
          }
        }
      }
    }
    Eigen::Map<Eigen::MatrixXf> target(output.values.data() + begin * static_cast<size_t>(outputs), outputs,
                                       panel.cols());
    target.noalias() = weights * panel;
    target.colwise() += bias;
    target = target.cwiseMax(0.0f);
  });
  return output;
}

FeatureMap maxPool(const FeatureMap& input, bool ceil) {
  // With ceil the last window must still begin inside, which is always so for windows of 3 with stride 2.
  const auto outputSide = [&](int side) { return (side - 3 + (ceil ? 1 : 0)) / 2 + 1; };
  CHECK(input.width >= (ceil ? 2 : 3));
  CHECK(input.height >= (ceil ? 2 : 3));
  FeatureMap output(outputSide(input.width), outputSide(input.height), input.channels);
  std::fill(output.values.begin(), output.values.end(), -std::numeric_limits<float>::infinity());
  float* target = output.values.data();
  for (int y = 0; y < output.height; ++y) {
    for (int x = 0; x < output.width; ++x, target += input.channels) {
      for (int j = 2 * y; j < std::min(2 * y + 3, input.height); ++j) {
        for (int i = 2 * x; i < std::min(2 * x + 3, input.width); ++i) {
          const float* source = input.values.data() + (static_cast<size_t>(j) * input.width + i) * input.channels;
          for (int c = 0; c < input.channels; ++c) target[c] = std::max(target[c], source[c]);
        }
      }
    }
  }
  return output;
}

FeatureNetwork::FeatureNetwork(Kind kind, const Safetensors& file, const fs::path& path) : kind_(kind) {
  int channels = 3;
  const auto plain = [&](bool poolsFirst, const std::string& name, int stride, int padding) {
    Stage stage;
    stage.poolsFirst = poolsFirst;
    stage.convolutions.push_back(loadConvolution(file, path, "features." + name, channels, stride, padding));
    channels = stage.convolutions.back().outputs;
    stages_.push_back(std::move(stage));
  };
  const auto fire = [&](bool poolsFirst, const std::string& name, bool isTap) {
    Stage stage;
    stage.poolsFirst = poolsFirst;
    stage.isTap = isTap;
    auto& layers = stage.convolutions;
    layers.push_back(loadConvolution(file, path, "features." + name + ".squeeze", channels, 1, 0));
    const int squeezed = layers[0].outputs;
    layers.push_back(loadConvolution(file, path, "features." + name + ".expand1x1", squeezed, 1, 0));
    layers.push_back(loadConvolution(file, path, "features." + name + ".expand3x3", squeezed, 1, 1));
    if (layers[0].kernel != 1 || layers[1].kernel != 1 || layers[2].kernel != 3) {
      throw Error(path.string(), name, "is not a fire module", "use LPIPS v0.1 weights with torchvision's layers");
    }
    channels = layers[1].outputs + layers[2].outputs;
    stages_.push_back(std::move(stage));
  };
  if (kind == Kind::alex) {
    plain(false, "0", 4, 2);
    plain(true, "3", 1, 2);
    plain(true, "6", 1, 1);
    plain(false, "8", 1, 1);
    plain(false, "10", 1, 1);
  } else {
    plain(false, "0", 2, 0);
    fire(true, "3", false);
    fire(false, "4", true);
    fire(true, "6", false);
    fire(false, "7", true);
    fire(true, "9", true);
    fire(false, "10", true);
    fire(false, "11", true);
    fire(false, "12", true);
  }
}

std::vector<FeatureMap> FeatureNetwork::taps(const FeatureMap& picture, ThreadPool& pool) const {
  std::vector<FeatureMap> tapped;
  FeatureMap current = picture;
  for (const Stage& stage : stages_) {
    if (stage.poolsFirst) current = maxPool(current, kind_ == Kind::squeeze);
    const auto& layers = stage.convolutions;
    current = layers[0](current, pool);
    if (layers.size() == 3) current = joined(layers[1](current, pool), layers[2](current, pool));
    if (stage.isTap) tapped.push_back(current);
  }
  return tapped;
}

std::vector<int> FeatureNetwork::tapChannels() const {
  std::vector<int> channels;
  for (const Stage& stage : stages_) {
    if (!stage.isTap) continue;
    const auto& layers = stage.convolutions;
    channels.push_back(layers.size() == 3 ? layers[1].outputs + layers[2].outputs : layers[0].outputs);
  }
  return channels;
}

}  // namespace tessera

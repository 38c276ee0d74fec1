#include "eval/lpips.h"

#include <cmath>

#include "base/check.h"
#include "base/error.h"

namespace tessera {
namespace {

constexpr float kShift[3] = {-0.030f, -0.088f, -0.188f}, kScale[3] = {0.458f, 0.448f, 0.450f};

std::string readNetName(const Safetensors& file, const fs::path& path) {
  const auto said = file.metadata.find("net");
  std::string net;
  if (said != file.metadata.end()) {
    net = said->second;
  } else {
    net = file.tensors.count("features.3.squeeze.weight") != 0 ? "squeeze" : "alex";
  }
  if (net != "alex" && net != "squeeze") {
    throw Error(path.string(), "net", "holds LPIPS weights of an unknown network, " + net, "use alex or squeeze");
  }
  return net;
}

FeatureMap networkInput(const ImageF& image) {
  FeatureMap input(image.width, image.height, 3);
  for (size_t i = 0; i < input.values.size(); ++i) {
    input.values[i] = (image.pixels[i] * 2 - 1 - kShift[i % 3]) / kScale[i % 3];
  }
  return input;
}

double layerDistance(const FeatureMap& a, const FeatureMap& b, const std::vector<float>& head) {
  const auto channels = static_cast<size_t>(a.channels);
  double sum = 0;
  for (size_t p = 0; p < a.positions(); ++p) {
    const float *fa = a.values.data() + p * channels, *fb = b.values.data() + p * channels;
    double squaresA = 0, squaresB = 0;
    for (size_t c = 0; c < channels; ++c) {
      squaresA += double{fa[c]} * fa[c];
      squaresB += double{fb[c]} * fb[c];
    }
    const double scaleA = 1 / (std::sqrt(squaresA) + 1e-10), scaleB = 1 / (std::sqrt(squaresB) + 1e-10);
    for (size_t c = 0; c < channels; ++c) {
      const double difference = fa[c] * scaleA - fb[c] * scaleB;
      sum += head[c] * difference * difference;
    }
  }
  return sum / static_cast<double>(a.positions());
}

}  // namespace

Lpips::Lpips(const fs::path& weights) : Lpips(weights, readSafetensors(weights)) {}

Lpips::Lpips(const fs::path& path, const Safetensors& file)
    : net_(readNetName(file, path)),
      network_(net_ == "alex" ? FeatureNetwork::Kind::alex : FeatureNetwork::Kind::squeeze, file, path) {
  const std::vector<int> channels = network_.tapChannels();
  for (size_t i = 0; i < channels.size(); ++i) {
    const std::string name = "lin" + std::to_string(i) + ".weight";
    const TensorView& head = file.require(path, name, TensorType::f32);
    if (head.elements() != channels[i]) {
      throw Error(path.string(), name, "does not have one weight for each channel", "use LPIPS v0.1 weights");
    }
    const auto values = head.as<float>();
    heads_.emplace_back(values.begin(), values.end());
  }
}

LpipsDistance Lpips::operator()(const ImageF& a, const ImageF& b, ThreadPool& pool) const {
  CHECK(a.channels == 3);
  CHECK(b.channels == 3);
  CHECK(a.width == b.width);
  CHECK(a.height == b.height);
  CHECK(a.width >= smallestSide());
  CHECK(a.height >= smallestSide());
  const auto tapsA = network_.taps(networkInput(a), pool), tapsB = network_.taps(networkInput(b), pool);
  LpipsDistance distance;
  for (size_t i = 0; i < tapsA.size(); ++i) {
    distance.layers.push_back(layerDistance(tapsA[i], tapsB[i], heads_[i]));
    distance.total += distance.layers.back();
  }
  return distance;
}

}  // namespace tessera

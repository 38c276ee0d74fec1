// The two small image networks whose features LPIPS compares: the convolutional parts of torchvision's AlexNet and
// SqueezeNet 1.1, forward only.
// Sources: Krizhevsky, "One weird trick for parallelizing convolutional neural networks" (2014); Iandola et al.,
// "SqueezeNet" (2016). Layer names and strides: torchvision/models/{alexnet,squeezenet}.py.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "base/safetensors.h"
#include "base/threads.h"

namespace tessera {

// Activations, rows from top to bottom, interleaved channels (height × width × channels).
struct FeatureMap {
  int width = 0, height = 0, channels = 0;
  std::vector<float> values;

  FeatureMap() = default;
  FeatureMap(int w, int h, int c)
      : width(w),
        height(h),
        channels(c),
        values(static_cast<size_t>(w) * static_cast<size_t>(h) * static_cast<size_t>(c)) {}
  size_t positions() const { return static_cast<size_t>(width) * static_cast<size_t>(height); }
};

// A convolution with bias, always followed by ReLU in these networks.
struct Convolution {
  int inputs = 0, outputs = 0, kernel = 0, stride = 1, padding = 0;
  Eigen::MatrixXf weights;  // outputs × (kernel row, kernel column, input)
  Eigen::VectorXf bias;

  FeatureMap operator()(const FeatureMap& input, ThreadPool& pool) const;
};

class FeatureNetwork {
 public:
  enum class Kind { alex, squeeze };

  // Reads the tensors `features.N.*` of `file`. Throws Error naming `path` if one is missing or has another shape.
  FeatureNetwork(Kind kind, const Safetensors& file, const fs::path& path);

  // Returns the activations at the taps of LPIPS: of AlexNet after each of its five ReLUs, of SqueezeNet after seven
  // of its stages.
  std::vector<FeatureMap> taps(const FeatureMap& picture, ThreadPool& pool) const;
  std::vector<int> tapChannels() const;
  // The smallest width and height of an image, pixels.
  int smallestSide() const { return kind_ == Kind::alex ? 31 : 17; }

 private:
  struct Stage {
    bool poolsFirst = false;
    // One convolution, or the three of a fire module (squeeze, expand 1×1, expand 3×3).
    std::vector<Convolution> convolutions;
    bool isTap = true;
  };

  Kind kind_;
  std::vector<Stage> stages_;
};

// Max pooling with 3×3 windows and stride 2. `ceil`: includes a last window that lies only partly inside (ceil_mode of
// torchvision).
FeatureMap maxPool(const FeatureMap& input, bool ceil);

}  // namespace tessera

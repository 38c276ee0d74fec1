// Learned perceptual image patch similarity, version 0.1: a distance between the network features of two images;
// 0 means equal.
// Source: Zhang, Isola, Efros, Shechtman, Wang, "The unreasonable effectiveness of deep features as a perceptual
// metric" (2018), equation 1, with the linear heads of the authors' release.
#pragma once

#include <string>
#include <vector>

#include "base/image.h"
#include "eval/feature_network.h"

namespace tessera {

struct LpipsDistance {
  double total = 0;
  std::vector<double> layers;  // contributions to the total
};

class Lpips {
 public:
  // Reads a safetensors file with `features.N.*` (torchvision's layers) and `linN.weight`; the metadata key "net" is
  // "alex" or "squeeze"; without it the layers of the file decide. Throws Error naming the path if a tensor is missing
  // or has another shape.
  explicit Lpips(const fs::path& weights);

  const std::string& net() const { return net_; }
  int smallestSide() const { return network_.smallestSide(); }

  // Compares two images in [0, 1] with 3 channels and the same size, each side at least smallestSide().
  LpipsDistance operator()(const ImageF& a, const ImageF& b, ThreadPool& pool) const;

 private:
  Lpips(const fs::path& path, const Safetensors& file);

  std::string net_;
  FeatureNetwork network_;
  std::vector<std::vector<float>> heads_;
};

}  // namespace tessera

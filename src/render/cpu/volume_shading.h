// What a content's deferred network adds to what its samples add up to, seen from a direction (City-on-Web, eq. 3).
#pragma once

#include <array>
#include <vector>

#include "render/cpu/volume_march.h"

namespace tessera {

// A unit direction d in scene axes as networks take it: d, sin(2^k d) for k = 0 … 3, cos(2^k d) likewise.
std::array<float, 27> encodeDirection(const Vec3d& direction);

// A network with its weights laid out for vectors over the outputs.
class DeferredShader {
 public:
  static constexpr uint32_t kInputs = 34, kOutputs = 3, kMostWidth = 256;

  // `network` is 34 → … → 3, no layer wider than kMostWidth. Keeps nothing of it.
  explicit DeferredShader(const std::vector<DenseLayer>& network);

  // Φ, in [0,1].
  std::array<float, 3> shade(const ContentComposite& composite, const std::array<float, 27>& direction) const;

  struct Layer {
    uint32_t inputs = 0, outputs = 0;  // the outputs rounded up to whole vectors
    std::vector<float> weights;        // [inputs][outputs]
    std::vector<float> biases;         // [outputs]
  };
  const std::vector<Layer>& layers() const { return layers_; }

 private:
  std::vector<Layer> layers_;
};

// Contents along a ray, blended front to back: C = Σ_k T_k (C_d^k + α^k Φ^k), T_k = Π_{j<k} (1 - α^j). A content that
// holds nothing (α = 0) adds nothing.
struct BlendedRay {
  std::array<float, 3> colour = {0, 0, 0};
  float transmittance = 1;
  float depth = 0;  // scene units along the ray, premultiplied

  void add(const ContentComposite& composite, const DeferredShader& shader, const std::array<float, 27>& direction);
};

}  // namespace tessera

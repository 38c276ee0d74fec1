// What a content's deferred network adds to what its samples add up to, seen from a direction (City-on-Web, eq. 3).
#pragma once

#include <array>
#include <span>
#include <vector>

#include "raymarch/cpu/shading.h"
#include "render/cpu/dense_network.h"
#include "representations/volume/cpu/volume_march.h"

namespace tessera {

// A unit direction d in scene axes as networks take it: d, sin(2^k d) for k = 0 … 3, cos(2^k d) likewise.
std::array<float, 27> encodeDirection(const Vec3d& direction);

class DeferredShader {
 public:
  static constexpr uint32_t kInputs = 34, kOutputs = 3;

  // `network` is 34 → … → 3. Keeps nothing of it.
  explicit DeferredShader(const std::vector<DenseLayer>& network) : network_(network, kInputs, kOutputs) {}

  // Φ, in [0,1].
  std::array<float, 3> shade(const ContentComposite& composite, const std::array<float, 27>& direction) const;

 private:
  DenseNetwork network_;
};

// Contents along a ray, blended front to back: C = Σ_k T_k (C_d^k + α^k Φ^k), T_k = Π_{j<k} (1 - α^j). A content that
// holds nothing (α = 0) adds nothing.
struct BlendedRay : DrawnPixel {
  void add(const ContentComposite& composite, const DeferredShader& shader, const std::array<float, 27>& direction);
};

// Every content has its own network, which is run once a ray.
class VolumeShading {
 public:
  VolumeShading(const std::vector<const VolumeContent*>& contents, const MarchSettings& settings);

  void begin(size_t lane, const BoundedRay& ray);
  float transmittance(size_t lane) const { return lanes_[lane].ray.transmittance; }
  void march(const VolumeContent& content, const VolumePart& part, std::span<const PartRay> rays,
             MarchCounts& counts) const;
  void add(size_t lane, const ContentComposite& composite, size_t content) {
    lanes_[lane].ray.add(composite, shaders_[content], lanes_[lane].direction);
  }
  void end(size_t lane, DrawnPixel& pixel) const { pixel = lanes_[lane].ray; }
  void finish() {}

 private:
  struct Lane {
    BlendedRay ray;
    std::array<float, 27> direction = {};
  };
  std::vector<DeferredShader> shaders_;
  MarchSettings settings_;
  std::array<Lane, kRayLanes> lanes_;
};

template <>
struct Shading<VolumeContent> {
  using Type = VolumeShading;
};

}  // namespace tessera

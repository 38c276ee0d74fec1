// Shades composited contents with their deferred networks, for a viewing direction (City-on-Web, eq. 3).
#pragma once

#include <array>
#include <span>
#include <vector>

#include "raymarch/cpu/shading.h"
#include "render/cpu/dense_network.h"
#include "representations/volume/cpu/volume_march.h"

namespace tessera {

// Returns the network inputs of a unit direction d in scene axes: d, sin(2^k d) for k = 0 … 3, then cos(2^k d) for the
// same k.
std::array<float, 27> encodeDirection(const Vec3d& direction);

class DeferredShader {
 public:
  static constexpr uint32_t kInputs = 34, kOutputs = 3;

  // `network`: layers 34 → … → 3. It is copied.
  explicit DeferredShader(const std::vector<DenseLayer>& network) : network_(network, kInputs, kOutputs) {}

  // Returns Φ, the specular colour, in [0,1].
  std::array<float, 3> shade(const ContentComposite& composite, const std::array<float, 27>& direction) const;

 private:
  DenseNetwork network_;
};

// Blends contents along a ray front to back: C = Σ_k T_k (C_d^k + α^k Φ^k), T_k = Π_{j<k} (1 - α^j). A content with α =
// 0 adds nothing.
struct BlendedRay : DrawnPixel {
  void add(const ContentComposite& composite, const DeferredShader& shader, const std::array<float, 27>& direction);
};

// Implements Shading: each content has its own network, which is evaluated once per ray.
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

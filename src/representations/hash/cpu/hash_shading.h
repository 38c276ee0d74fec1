// Computes a ray's colour from the features that are composited over all contents together (NGP-RT, eq. 5). Because
// features are composited before the colour is computed, a scene looks the same however it is divided into blocks.
// Blending finished colours would not have this property: the sigmoid of a sum is not a sum of sigmoids.
#pragma once

#include <array>
#include <span>
#include <unordered_map>
#include <utility>
#include <vector>

#include "raymarch/cpu/shading.h"
#include "render/cpu/dense_network.h"
#include "representations/hash/cpu/hash_march.h"

namespace tessera {

// Composites C_d = Σ_k T_k C_d^k, and F in the same way, with T_k = Π_{j<k} (1 - α^j). One network is evaluated for
// each ray: z = C_d + ψ(C_d, F, harmonics), and the colour is (1 - T) sigmoid(z). If the contents have a learned
// background and no other object stands at the ray's end, the pixel is opaque with the colour sigmoid(z). Contents with
// equal parameters, such as those of one level of detail, share a network; the network with the largest sum of T_k α^k
// is used, or that of the last content if the ray hits nothing. Networks are evaluated for many rays at a time.
class HashShading {
 public:
  static constexpr uint32_t kInputs = 23, kOutputs = 3;

  HashShading(const std::vector<const HashContent*>& contents, const MarchSettings& settings);

  void begin(size_t lane, const BoundedRay& ray);
  float transmittance(size_t lane) const { return lanes_[lane].sums.transmittance; }
  void march(const HashContent& content, const HashPart& part, std::span<const PartRay> rays, MarchCounts& counts);
  void add(size_t lane, const ContentComposite& composite, size_t content);
  void end(size_t lane, DrawnPixel& pixel);
  void finish();

 private:
  struct Lane {
    ContentComposite sums;
    Vec3d direction = Vec3d::UnitZ();
    bool isOpen = true;                             // no other object stands at the ray's end
    std::vector<std::pair<size_t, float>> weights;  // (network, weight) of contents hit
  };
  struct PendingPixel {
    DrawnPixel* pixel;
    ContentComposite sums;
    Vec3d direction;
    size_t network;
    bool isOpaque;  // it shows the learned background
  };

  std::vector<DenseNetwork> networks_;    // without duplicates
  std::vector<size_t> networkOfContent_;  // [contents], indices of networks_
  std::unordered_map<const HashPart*, HashFeatures> features_;
  bool hasLearnedBackground_ = false;
  MarchSettings settings_;
  std::array<Lane, kRayLanes> lanes_;
  std::array<HashRay, kRayLanes> rays_;  // through one part
  std::vector<PendingPixel> pending_;
};

template <>
struct Shading<HashContent> {
  using Type = HashShading;
};

}  // namespace tessera

// The colour of what a ray's samples add up to, in all contents together (NGP-RT, eq. 5): sums of features know no
// contents, so that what is cut into blocks looks as it did uncut. Blending finished colours would not: a sigmoid of a
// sum is no sum of sigmoids.
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

// The first 16 real spherical harmonics of a unit direction, in the order and with the signs of tiny-cuda-nn.
std::array<float, 16> harmonicsOf(const Vec3d& direction);

// C_d = Σ_k T_k C_d^k, F likewise, T_k = Π_{j<k} (1 - α^j). Once a ray, the network of those contents whose T_k α^k add
// up to most (contents with the same numbers have the same network: those of a level) says z = C_d + ψ(C_d, F,
// harmonics); the colour is (1 - T) sigmoid(z), or sigmoid(z) and opaque where contents are whole, unless something
// else stands at the ray's end. Where nothing is met, the last content's network speaks. Networks are run for many rays
// at a time.
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
    bool isOpen = true;                             // nothing else is known to be at its end
    std::vector<std::pair<size_t, float>> weights;  // of networks that have been met
  };
  struct Waiting {
    DrawnPixel* pixel;
    ContentComposite sums;
    Vec3d direction;
    size_t network;
    bool whole;
  };

  std::vector<DenseNetwork> networks_;    // each once
  std::vector<size_t> networkOfContent_;  // its number, of each content
  std::unordered_map<const HashPart*, HashFeatures> features_;
  bool isWhole_ = false;
  MarchSettings settings_;
  std::array<Lane, kRayLanes> lanes_;
  std::array<HashRay, kRayLanes> rays_;  // through one part
  std::vector<Waiting> waiting_;
};

template <>
struct Shading<HashContent> {
  using Type = HashShading;
};

}  // namespace tessera

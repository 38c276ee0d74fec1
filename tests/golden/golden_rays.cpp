#include "golden/golden_rays.h"

#include <algorithm>
#include <cmath>

#include "base/random.h"
#include "representations/hash/testing/reference_hash.h"
#include "representations/mesh/testing/reference_mesh.h"
#include "representations/volume/testing/reference_volume.h"

namespace tessera::golden {
namespace {

constexpr uint64_t kRaysOfKind = 12, kKinds = 5, kMeshKinds = 6;
constexpr double kSceneEnd = TileFrame::kSceneEnd;

// Evaluates a network without an activation at the outputs.
std::vector<double> runNetwork(const std::vector<DenseLayer>& network, std::vector<double> values) {
  for (size_t layer = 0; layer < network.size(); ++layer) {
    std::vector<double> outputs;
    for (uint32_t o = 0; o < network[layer].outputs; ++o) {
      double sum = network[layer].biases[o];
      for (uint32_t i = 0; i < network[layer].inputs; ++i) {
        sum += static_cast<double>(network[layer].weights[size_t{o} * network[layer].inputs + i]) * values[i];
      }
      outputs.push_back(layer + 1 < network.size() ? std::max(sum, 0.0) : sum);
    }
    values = std::move(outputs);
  }
  return values;
}

// Evaluates the deferred network as section 6 defines it.
std::array<double, 3> shade(const std::vector<DenseLayer>& network, const ReferenceComposite& composite,
                            const Vec3d& direction) {
  std::vector<double> values(composite.values, composite.values + 7);
  for (Eigen::Index c = 0; c < 3; ++c) values.push_back(direction[c]);
  for (const bool cosine : {false, true}) {
    for (int k = 0; k < 4; ++k) {
      for (Eigen::Index c = 0; c < 3; ++c) {
        const double angle = (1 << k) * direction[c];
        values.push_back(cosine ? std::cos(angle) : std::sin(angle));
      }
    }
  }
  values = runNetwork(network, values);
  for (double& value : values) value = 1 / (1 + std::exp(-value));
  return {values[0], values[1], values[2]};
}

template <class Part>
struct Piece {
  const Part* part;
  RayRange range;
};

template <class Content>
ReferenceComposite marchPieces(const Content& content, const auto& pieces, const ExpectedRay& ray) {
  ReferenceComposite composite;
  for (const auto& piece : pieces) {
    referenceMarch(content, *piece.part, {ray.origin, ray.direction}, piece.range, composite);
  }
  return composite;
}

// `volume`: each content is shaded by its own network, and the colours are blended.
class VolumeBlend {
 public:
  explicit VolumeBlend(ExpectedRay& ray) : ray_(ray) {}
  void add(const VolumeContent& content, const ReferenceComposite& composite) {
    if (composite.samples == 0) return;
    const std::array<double, 3> specular = shade(content.network, composite, ray_.direction);
    for (size_t c = 0; c < 3; ++c) {
      ray_.colour[c] += transmittance_ * (composite.values[c] + (1 - composite.transmittance) * specular[c]);
    }
    ray_.distance += transmittance_ * composite.depth;
    transmittance_ *= composite.transmittance;
  }
  void end() { ray_.opacity = 1 - transmittance_; }

 private:
  ExpectedRay& ray_;
  double transmittance_ = 1;
};

// `hash`: the sums of all contents are shaded once, by the network that contributes most to the ray.
class HashBlend {
 public:
  explicit HashBlend(ExpectedRay& ray) : ray_(ray) {}
  void add(const HashContent& content, const ReferenceComposite& composite) {
    const auto known = std::find_if(networks_.begin(), networks_.end(),
                                    [&](const auto& one) { return *one.first == content.network; });
    const double weight = sums_.transmittance * (1 - composite.transmittance);
    if (known != networks_.end())
      known->second += weight;
    else
      networks_.emplace_back(&content.network, weight);
    for (int k = 0; k < 7; ++k) sums_.values[k] += sums_.transmittance * composite.values[k];
    ray_.distance += sums_.transmittance * composite.depth;
    sums_.transmittance *= composite.transmittance;
  }
  void end() {
    ray_.opacity = 1 - sums_.transmittance;
    if (ray_.opacity <= 0) return;
    const auto heaviest = std::max_element(networks_.begin(), networks_.end(),
                                           [](const auto& a, const auto& b) { return a.second < b.second; });
    std::vector<double> values(sums_.values, sums_.values + 7);
    for (const double harmonic : harmonics(ray_.direction)) values.push_back(harmonic);
    values = runNetwork(*heaviest->first, values);
    for (size_t c = 0; c < 3; ++c) ray_.colour[c] = ray_.opacity / (1 + std::exp(-(sums_.values[c] + values[c])));
  }

 private:
  // Real spherical harmonics by their formulas, in tiny-cuda-nn's order: by degree l, and for each by m from -l to l.
  static std::vector<double> harmonics(const Vec3d& d) {
    const double x = d.x(), y = d.y(), z = d.z(), pi = std::acos(-1.0);
    const double a1 = std::sqrt(3 / (4 * pi)), a2 = std::sqrt(15 / (4 * pi)), a3 = std::sqrt(35 / (32 * pi)),
                 b3 = std::sqrt(105 / (4 * pi)), c3 = std::sqrt(21 / (32 * pi));
    return {std::sqrt(1 / (4 * pi)),
            -a1 * y,
            a1 * z,
            -a1 * x,
            a2 * x * y,
            -a2 * y * z,
            std::sqrt(5 / (16 * pi)) * (3 * z * z - 1),
            -a2 * x * z,
            a2 / 2 * (x * x - y * y),
            -a3 * y * (3 * x * x - y * y),
            b3 * x * y * z,
            -c3 * y * (5 * z * z - 1),
            std::sqrt(7 / (16 * pi)) * z * (5 * z * z - 3),
            -c3 * x * (5 * z * z - 1),
            b3 / 2 * z * (x * x - y * y),
            -a3 * x * (x * x - 3 * y * y)};
  }

  ExpectedRay& ray_;
  ReferenceComposite sums_;
  std::vector<std::pair<const std::vector<DenseLayer>*, double>> networks_;  // networks and their visible weights
};

template <class Content, class Blend>
void look(const Scene<Content>& scene, ExpectedRay& ray) {
  using Part = typename decltype(Content::parts)::value_type;
  const SceneRay along{ray.origin, ray.direction};
  const SceneBox bounds = scene.tileset.box();
  const RayRange box = clipToBox(along, bounds.low, bounds.high, {scene.tileset.near, INFINITY});
  std::vector<std::string> names = {"0_0", "1_0"};  // the cell of the camera first
  if (ray.origin.x() >= 0) std::swap(names[0], names[1]);
  if (ray.level == 1) names = {"all"};
  Blend blend(ray);
  for (const std::string& name : names) {
    const Content& content = scene.contents.at(name);
    std::vector<Piece<Part>> pieces;
    for (const Part& part : content.parts) {
      const Vec3d low(part.low[0], part.low[1], part.low[2]), high(part.high[0], part.high[1], part.high[2]);
      const RayRange range = clipToBox(along, low, high, box);
      if (!box.empty() && !range.empty()) pieces.push_back({&part, range});
    }
    std::sort(pieces.begin(), pieces.end(),
              [](const Piece<Part>& a, const Piece<Part>& b) { return a.range.near < b.range.near; });
    blend.add(content, marchPieces(content, pieces, ray));
  }
  const Content& backgroundBlock = scene.contents.at(ray.level == 1 ? "coarse_background_block" : "background_block");
  const std::vector<Piece<Part>> behind = {
      {backgroundBlock.parts.data(), {box.empty() ? scene.tileset.near : box.far, kSceneEnd}}};
  blend.add(backgroundBlock, marchPieces(backgroundBlock, behind, ray));
  blend.end();
}

// Contents of `mesh` have no order, and the background block has no march.
ReferenceMeshView viewOnLevel(const Scene<MeshContent>& scene, uint32_t level) {
  ReferenceMeshView view;
  const SceneBox bounds = scene.tileset.box();
  view.low = bounds.low;
  view.high = bounds.high;
  view.near = scene.tileset.near;
  for (const char* name : {"0_0", "1_0"})
    if (level == 0) view.blocks.push_back({&scene.contents.at(name)});
  if (level == 1) view.blocks.push_back({&scene.contents.at("all")});
  view.background = &scene.contents.at(level == 1 ? "coarse_background_block" : "background_block");
  return view;
}

// Returns ray number `i`, not yet looked along. Each `attempt` gives another ray of the same kind.
ExpectedRay makeRay(uint64_t i, uint64_t attempt) {
  const RandomStream random(2024, 70);
  const uint64_t number = i + kMeshKinds * kRaysOfKind * attempt;
  const auto value = [&](uint64_t k) { return std::floor(64 * (2 * random.uniformDouble(8 * number + k) - 1)) / 64; };
  ExpectedRay ray;
  ray.level = i % 3 == 2 ? 1 : 0;
  Vec3d target(1.9 * value(0), 0.9 * value(1), -0.45);
  switch (i / kRaysOfKind) {
    case 0:  // from outside to something on the ground
      ray.origin = Vec3d(4 * value(2), 3 * value(3), 2 + value(4));
      break;
    case 1:  // over the ground and out of the box
      ray.origin = Vec3d(1.5 * value(2), 0.75 * value(3), 0.6 + 0.1 * value(4));
      target = Vec3d(6 * value(0), 5 * value(1), 0.4 * value(5));
      break;
    case 2:  // past the box, to the distant ground or to the sky
      ray.origin = Vec3d(3 + value(2), 2 * value(3), 1.5);
      target = ray.origin + Vec3d(1, value(0), 0.25 * value(1));
      break;
    case 3:  // so low over a roof or the ground that the ray samples several contents
      if (i % 2 == 0) {
        ray.origin = Vec3d(-3, 0.25 * value(2), 0.47 + 0.03 * value(3));
        target = Vec3d(-0.8, 0.2 * value(4), 0.46 + 0.02 * value(5));
      } else {
        ray.origin = Vec3d(-3, 0.6 + 0.2 * value(2), -0.3 + 0.05 * value(3));
        target = Vec3d(0, 0.6 + 0.2 * value(4), -0.38 + 0.04 * value(5));
      }
      break;
    case 4:  // along an axis, from above or from the side
      ray.origin = Vec3d(1.8 * value(2), 0.8 * value(3), 0.3 * value(4));
      ray.origin[static_cast<Eigen::Index>(i % 3)] = i % 2 == 0 ? 3 : -3;
      if (i % 3 == 2) ray.origin.z() = 3;
      target = ray.origin;
      target[static_cast<Eigen::Index>(i % 3)] = 0;
      break;
    default:  // to where contents of `mesh` overlap
      ray.origin = Vec3d(2.5 * value(2), 1.5 * value(3), 0.2 + 0.4 * value(4));
      target.x() = 0.25 * value(5);
  }
  ray.direction = (target - ray.origin).normalized();
  return ray;
}

template <class Content, class Blend>
std::vector<ExpectedRay> raysThrough(const Scene<Content>& scene) {
  std::vector<ExpectedRay> rays;
  for (uint64_t i = 0; i < kKinds * kRaysOfKind; ++i) {
    rays.push_back(makeRay(i, 0));
    look<Content, Blend>(scene, rays.back());
  }
  return rays;
}

}  // namespace

std::vector<ExpectedRay> makeRays(const Scene<VolumeContent>& scene) {
  return raysThrough<VolumeContent, VolumeBlend>(scene);
}

std::vector<ExpectedRay> makeRays(const Scene<HashContent>& scene) {
  return raysThrough<HashContent, HashBlend>(scene);
}

std::vector<ExpectedRay> makeRays(const Scene<MeshContent>& scene) {
  std::vector<ExpectedRay> rays;
  for (uint64_t i = 0; i < kMeshKinds * kRaysOfKind; ++i) {
    for (uint64_t attempt = 0; rays.size() == i; ++attempt) {
      ExpectedRay ray = makeRay(i, attempt);
      const ReferenceMeshView view = viewOnLevel(scene, ray.level);
      if (isReferenceMeshUnsure(view, {ray.origin, ray.direction})) continue;
      const ReferenceMeshPixel pixel = traceReferenceMesh(view, {ray.origin, ray.direction});
      ray.colour = pixel.colour;
      ray.opacity = pixel.opacity;
      ray.distance = pixel.distance;
      rays.push_back(ray);
    }
  }
  return rays;
}

}  // namespace tessera::golden

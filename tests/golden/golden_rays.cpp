#include "golden/golden_rays.h"

#include <algorithm>
#include <cmath>

#include "base/random.h"
#include "render/cpu/reference_volume.h"

namespace tessera::golden {
namespace {

constexpr uint64_t kRaysOfKind = 12, kKinds = 5;
constexpr double kSceneEnd = TileFrame::kSceneEnd;

// The deferred network, as section 6 has it.
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
  for (size_t layer = 0; layer < network.size(); ++layer) {
    std::vector<double> outputs;
    for (uint32_t o = 0; o < network[layer].outputs; ++o) {
      double sum = network[layer].biases[o];
      for (uint32_t i = 0; i < network[layer].inputs; ++i) {
        sum += network[layer].weights[size_t{o} * network[layer].inputs + i] * values[i];
      }
      outputs.push_back(layer + 1 < network.size() ? std::max(sum, 0.0) : 1 / (1 + std::exp(-sum)));
    }
    values = std::move(outputs);
  }
  return {values[0], values[1], values[2]};
}

struct Piece {
  const VolumePart* part;
  RayRange range;
};

// Adds a content to what the ray has met before it, of which `transmittance` is left.
void blend(const VolumeContent& content, const std::vector<Piece>& pieces, ExpectedRay& ray, double& transmittance) {
  ReferenceComposite composite;
  for (const Piece& piece : pieces) {
    referenceMarch(content, *piece.part, {ray.origin, ray.direction}, piece.range, composite);
  }
  if (composite.samples == 0) return;
  const std::array<double, 3> specular = shade(content.network, composite, ray.direction);
  for (size_t c = 0; c < 3; ++c) {
    ray.colour[c] += transmittance * (composite.values[c] + (1 - composite.transmittance) * specular[c]);
  }
  ray.distance += transmittance * composite.depth;
  transmittance *= composite.transmittance;
}

void look(const Scene& scene, ExpectedRay& ray) {
  const SceneRay along{ray.origin, ray.direction};
  const SceneBox bounds = scene.tileset.box();
  const RayRange box = clipToBox(along, bounds.low, bounds.high, {scene.tileset.near, INFINITY});
  std::vector<std::string> names = {"0_0", "1_0"};  // the camera's cell first
  if (ray.origin.x() >= 0) std::swap(names[0], names[1]);
  if (ray.level == 1) names = {"all"};
  double transmittance = 1;
  for (const std::string& name : names) {
    const VolumeContent& content = scene.contents.at(name);
    std::vector<Piece> pieces;
    for (const VolumePart& part : content.parts) {
      const Vec3d low(part.low[0], part.low[1], part.low[2]), high(part.high[0], part.high[1], part.high[2]);
      const RayRange range = clipToBox(along, low, high, box);
      if (!box.empty() && !range.empty()) pieces.push_back({&part, range});
    }
    std::sort(pieces.begin(), pieces.end(), [](const Piece& a, const Piece& b) { return a.range.near < b.range.near; });
    blend(content, pieces, ray, transmittance);
  }
  const VolumeContent& surround = scene.contents.at(ray.level == 1 ? "coarse_surround" : "surround");
  blend(surround, {{surround.parts.data(), {box.empty() ? scene.tileset.near : box.far, kSceneEnd}}}, ray,
        transmittance);
  ray.opacity = 1 - transmittance;
}

}  // namespace

std::vector<ExpectedRay> makeRays(const Scene& scene) {
  const RandomStream random(2024, 70);
  std::vector<ExpectedRay> rays;
  for (uint64_t i = 0; i < kKinds * kRaysOfKind; ++i) {
    const auto value = [&](uint64_t k) { return std::floor(64 * (2 * random.uniformDouble(8 * i + k) - 1)) / 64; };
    ExpectedRay ray;
    ray.level = i % 3 == 2 ? 1 : 0;
    Vec3d target(1.9 * value(0), 0.9 * value(1), -0.45);
    switch (i / kRaysOfKind) {
      case 0:  // from outside to what stands on the ground
        ray.origin = Vec3d(4 * value(2), 3 * value(3), 2 + value(4));
        break;
      case 1:  // over the ground and out of the box
        ray.origin = Vec3d(1.5 * value(2), 0.75 * value(3), 0.6 + 0.1 * value(4));
        target = Vec3d(6 * value(0), 5 * value(1), 0.4 * value(5));
        break;
      case 2:  // past the box, to the ground far away or to the sky
        ray.origin = Vec3d(3 + value(2), 2 * value(3), 1.5);
        target = ray.origin + Vec3d(1, value(0), 0.25 * value(1));
        break;
      case 3:  // over a roof or the ground so low that something is met of several contents
        if (i % 2 == 0) {
          ray.origin = Vec3d(-3, 0.25 * value(2), 0.47 + 0.03 * value(3));
          target = Vec3d(-0.8, 0.2 * value(4), 0.46 + 0.02 * value(5));
        } else {
          ray.origin = Vec3d(-3, 0.6 + 0.2 * value(2), -0.3 + 0.05 * value(3));
          target = Vec3d(0, 0.6 + 0.2 * value(4), -0.38 + 0.04 * value(5));
        }
        break;
      default:  // along an axis, from above or from the side
        ray.origin = Vec3d(1.8 * value(2), 0.8 * value(3), 0.3 * value(4));
        ray.origin[static_cast<Eigen::Index>(i % 3)] = i % 2 == 0 ? 3 : -3;
        if (i % 3 == 2) ray.origin.z() = 3;
        target = ray.origin;
        target[static_cast<Eigen::Index>(i % 3)] = 0;
    }
    ray.direction = (target - ray.origin).normalized();
    look(scene, ray);
    rays.push_back(ray);
  }
  return rays;
}

}  // namespace tessera::golden

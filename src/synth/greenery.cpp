#include <algorithm>
#include <numbers>

#include "synth/city_geometry.h"

namespace tessera {
namespace {

constexpr float kTurn = 2 * std::numbers::pi_v<float>;

Vec3f onSphere(RandomSequence& random) {
  const float z = random.between(-1, 1), angle = kTurn * random.uniform(), r = std::sqrt(std::max(0.f, 1 - z * z));
  return {r * std::cos(angle), r * std::sin(angle), z};
}

void addCard(const Vec3f& centre, float size, uint32_t object, RandomSequence& random, SurfaceMesh& mesh) {
  const Vec3f normal = onSphere(random);
  const Vec3f right = normal.cross(std::abs(normal.z()) < 0.9f ? Vec3f(0, 0, 1) : Vec3f(1, 0, 0)).normalized();
  mesh.addLeafCard(centre, right * (0.5f * size), normal.cross(right) * (0.5f * size), object);
}

// Boughs end in clumps; cards crowd round the clumps, so light falls between them.
void addBroadleaf(const Tree& tree, const Vec3f& foot, uint32_t leaves, uint32_t bark, RandomSequence& random,
                  SurfaceMesh& mesh) {
  const float crownLow = 0.28f * tree.height, crownHigh = tree.height;
  const Vec3f middle = foot + Vec3f(0, 0, 0.5f * (crownLow + crownHigh));
  const Vec3f radii(tree.radius, tree.radius, 0.5f * (crownHigh - crownLow));
  const Vec3f fork = foot + Vec3f(random.between(-0.2f, 0.2f), random.between(-0.2f, 0.2f), 0.42f * tree.height);
  mesh.addTube(foot - Vec3f(0, 0, 0.5f), fork, 0.035f * tree.height, 0.022f * tree.height, 6, Material::bark, bark);
  const int clumps = 9 + random.below(5);
  const float card =
      std::clamp(0.28f * tree.radius * std::sqrt(300.f / static_cast<float>(tree.leafCards)), 0.5f, 1.5f);
  for (int i = 0; i < clumps; ++i) {
    const Vec3f direction = onSphere(random);
    const Vec3f clump = middle + Vec3f(direction.cwiseProduct(radii) * random.between(0.35f, 0.72f));
    mesh.addTube(fork, clump, 0.012f * tree.height, 0.004f * tree.height, 3, Material::bark, bark);
    const float spread = tree.radius * random.between(0.38f, 0.52f);
    for (int k = 0; k < tree.leafCards / clumps; ++k) {
      const Vec3f offset = onSphere(random) * (spread * std::cbrt(random.between(0.25f, 1)));
      addCard(clump + offset, card * random.between(0.8f, 1.25f), leaves, random, mesh);
    }
  }
}

void addConifer(const Tree& tree, const Vec3f& foot, uint32_t leaves, uint32_t bark, RandomSequence& random,
                SurfaceMesh& mesh) {
  mesh.addTube(foot - Vec3f(0, 0, 0.5f), foot + Vec3f(0, 0, tree.height * 0.96f), 0.025f * tree.height, 0.03f, 5,
               Material::bark, bark);
  const float card = std::clamp(0.75f * std::sqrt(300.f / static_cast<float>(tree.leafCards)), 0.7f, 1.8f);
  for (int i = 0; i < tree.leafCards; ++i) {
    const float t = 1 - std::sqrt(random.uniform());  // denser below, where the cone is wide
    const float tier = fraction(t * 9);
    const float r = tree.radius * (1 - t) * (0.65f + 0.4f * (1 - tier)) * std::sqrt(random.between(0.1f, 1));
    const float angle = kTurn * random.uniform();
    addCard(foot + Vec3f(r * std::cos(angle), r * std::sin(angle), tree.height * (0.1f + 0.9f * t)), card, leaves,
            random, mesh);
  }
}

}  // namespace

void addTree(const Tree& tree, float ground, SurfaceMesh& mesh) {
  RandomSequence random(tree.seed);
  const Vec3f foot(tree.foot.x(), tree.foot.y(), ground);
  SurfaceObject look;
  look.seed = random.seed();
  look.centre = foot + Vec3f(0, 0, 0.6f * tree.height);
  look.height = tree.height;
  look.width = tree.radius;
  const float tone = random.uniform();
  look.colour =
      tree.conifer ? Vec3f(0.045f, 0.10f, 0.055f) : mix(Vec3f(0.10f, 0.19f, 0.035f), Vec3f(0.19f, 0.24f, 0.05f), tone);
  if (!tree.conifer && random.chance(0.08f)) look.colour = {0.30f, 0.10f, 0.06f};  // copper beech
  look.style = tree.conifer ? 1 : 0;
  const uint32_t leaves = mesh.addObject(look);
  const uint32_t bark = mesh.addObject({.seed = look.seed, .colour = {0.16f, 0.12f, 0.09f}});
  if (tree.conifer) {
    addConifer(tree, foot, leaves, bark, random, mesh);
  } else {
    addBroadleaf(tree, foot, leaves, bark, random, mesh);
  }
}

}  // namespace tessera

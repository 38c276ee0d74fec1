#include "synth/city_geometry.h"

namespace tessera {
namespace {

// A parabola stands for the catenary: they differ by millimetres at this sag.
void addWire(const Vec3f& from, const Vec3f& to, float sag, uint32_t object, SurfaceMesh& mesh) {
  constexpr int kPieces = 10;
  constexpr float kRadius = 0.022f;
  const auto point = [&](int i) {
    const float t = static_cast<float>(i) / kPieces;
    return Vec3f(mix(from, to, t) - Vec3f(0, 0, 4 * sag * t * (1 - t)));
  };
  for (int i = 0; i < kPieces; ++i) mesh.addTube(point(i), point(i + 1), kRadius, kRadius, 3, Material::wire, object);
}

}  // namespace

void addStreetFurniture(const CityLayout& city, SurfaceMesh& mesh) {
  const uint32_t wood = mesh.addObject({.seed = city.seed, .colour = {0.22f, 0.16f, 0.11f}});
  const uint32_t steel = mesh.addObject({.seed = city.seed, .colour = {0.30f, 0.31f, 0.32f}});
  const uint32_t wire = mesh.addObject({.seed = city.seed, .colour = {0.03f, 0.03f, 0.03f}});
  const auto stand = [&](const Vec2f& p) { return Vec3f(p.x(), p.y(), city.ground(p.x(), p.y())); };

  for (size_t i = 0; i < city.poles.size(); ++i) {
    const Pole& pole = city.poles[i];
    const Vec3f foot = stand(pole.foot), top = foot + Vec3f(0, 0, pole.height);
    mesh.addTube(foot - Vec3f(0, 0, 1), top, 0.17f, 0.11f, 6, Material::wood, wood);
    // The cross arm stands square to the line.
    const size_t other = pole.wires ? i + 1 : i - 1;
    const Vec2f d = city.poles[other].foot - pole.foot;
    const Vec3f across = Vec3f(-d.y(), d.x(), 0).normalized() * (pole.wires ? 1.f : -1.f);
    const Vec3f arm = top - Vec3f(0, 0, 0.5f);
    mesh.addTube(arm - across * 1.1f, arm + across * 1.1f, 0.07f, 0.07f, 4, Material::wood, wood);
    if (!pole.wires) continue;
    const Vec3f nextArm = stand(city.poles[i + 1].foot) + Vec3f(0, 0, city.poles[i + 1].height - 0.5f);
    for (float side : {-1.f, 0.f, 1.f})
      addWire(arm + across * side + Vec3f(0, 0, 0.2f), nextArm + across * side + Vec3f(0, 0, 0.2f), 0.9f, wire, mesh);
  }
  for (const Pole& lamp : city.lamps) {
    const Vec3f foot = stand(lamp.foot), top = foot + Vec3f(0, 0, lamp.height);
    mesh.addTube(foot, top, 0.09f, 0.06f, 5, Material::lamp, steel);
    mesh.addBox(top - Vec3f(0, 0, 0.05f), {0.9f, 0.9f, 0.14f}, 0, Material::lamp, steel);
  }
}

}  // namespace tessera

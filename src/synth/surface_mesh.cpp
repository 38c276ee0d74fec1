#include "synth/surface_mesh.h"

#include <numbers>

namespace tessera {

SurfaceClass classOfMaterial(Material material) {
  switch (material) {
    case Material::terrain:
    case Material::blockTop:
    case Material::kerb:
      return SurfaceClass::ground;
    case Material::facade:
    case Material::plain:
    case Material::awning:
      return SurfaceClass::facade;
    case Material::parapet:
    case Material::flatRoof:
    case Material::tileRoof:
    case Material::metal:
    case Material::vents:
    case Material::solarPanel:
    case Material::skylight:
      return SurfaceClass::roof;
    case Material::bark:
    case Material::leaf:
      return SurfaceClass::tree;
    case Material::water:
      return SurfaceClass::water;
    case Material::wood:
    case Material::wire:
    case Material::lamp:
      return SurfaceClass::wire;
    case Material::carPaint:
    case Material::carGlass:
    case Material::rubber:
      break;
  }
  return SurfaceClass::car;
}

uint32_t SurfaceMesh::addObject(const SurfaceObject& object) {
  objects.push_back(object);
  return static_cast<uint32_t>(objects.size() - 1);
}

uint32_t SurfaceMesh::addVertex(const Vec3f& p, const Vec2f& uv) {
  positions.push_back(p);
  textureAt.push_back(uv);
  return static_cast<uint32_t>(positions.size() - 1);
}

void SurfaceMesh::addTriangle(const Vec3f& a, const Vec3f& b, const Vec3f& c, Material material, uint32_t object) {
  const Vec3f along = (b - a).normalized();
  const Vec3f normal = (b - a).cross(c - a);
  const Vec3f up = normal.normalized().cross(along);
  const uint32_t ia = addVertex(a, {0, 0});
  const uint32_t ib = addVertex(b, {(b - a).norm(), 0});
  const uint32_t ic = addVertex(c, {(c - a).dot(along), (c - a).dot(up)});
  faces.push_back({ia, ib, ic, object, material});
}

void SurfaceMesh::addQuad(const Vec3f& a, const Vec3f& b, const Vec3f& c, const Vec3f& d, Material material,
                          uint32_t object, Vec2f uv) {
  const float w = (b - a).norm(), h = (d - a).norm();
  const uint32_t ia = addVertex(a, uv), ib = addVertex(b, uv + Vec2f(w, 0));
  const uint32_t ic = addVertex(c, uv + Vec2f(w, h)), id = addVertex(d, uv + Vec2f(0, h));
  faces.push_back({ia, ib, ic, object, material});
  faces.push_back({ia, ic, id, object, material});
}

void SurfaceMesh::addBox(const Vec3f& foot, const Vec3f& size, float yaw, Material material, uint32_t object) {
  const Vec3f x = Vec3f(std::cos(yaw), std::sin(yaw), 0) * (0.5f * size.x());
  const Vec3f y = Vec3f(-std::sin(yaw), std::cos(yaw), 0) * (0.5f * size.y());
  const Vec3f z(0, 0, size.z());
  const Vec3f p[4] = {foot - x - y, foot + x - y, foot + x + y, foot - x + y};
  for (int i = 0; i < 4; ++i) addQuad(p[i], p[(i + 1) % 4], p[(i + 1) % 4] + z, p[i] + z, material, object);
  addQuad(p[0] + z, p[1] + z, p[2] + z, p[3] + z, material, object);
}

void SurfaceMesh::addTube(const Vec3f& from, const Vec3f& to, float radiusFrom, float radiusTo, int sides,
                          Material material, uint32_t object) {
  const Vec3f axis = (to - from).normalized();
  const Vec3f x = axis.cross(std::abs(axis.z()) < 0.9f ? Vec3f(0, 0, 1) : Vec3f(1, 0, 0)).normalized();
  const Vec3f y = axis.cross(x);
  const auto ring = [&](int i) {
    const float angle = 2 * std::numbers::pi_v<float> * static_cast<float>(i) / static_cast<float>(sides);
    return Vec3f(x * std::cos(angle) + y * std::sin(angle));
  };
  for (int i = 0; i < sides; ++i) {
    const Vec3f p = ring(i), q = ring((i + 1) % sides);
    addQuad(from + p * radiusFrom, from + q * radiusFrom, to + q * radiusTo, to + p * radiusTo, material, object);
  }
}

void SurfaceMesh::addLeafCard(const Vec3f& centre, const Vec3f& right, const Vec3f& up, uint32_t object) {
  leafCorners.push_back(centre - right - up);
  leafCorners.push_back(centre + right - up);
  leafCorners.push_back(centre + right + up);
  leafCorners.push_back(centre - right + up);
  leafObjects.push_back(object);
}

}  // namespace tessera

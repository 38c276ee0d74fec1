// Triangles with texture coordinates in metres, and the object table that procedural materials read.
#pragma once

#include <cstdint>
#include <vector>

#include "synth/noise.h"

namespace tessera {

enum class Material : uint16_t {
  terrain,   // streets and country, textured by world position
  blockTop,  // pavements, lawns and squares, textured by world position
  kerb,
  facade,
  parapet,
  flatRoof,
  tileRoof,
  plain,  // painted or rendered surface in the object's colour
  metal,
  vents,
  solarPanel,
  skylight,
  awning,
  water,
  bark,
  leaf,
  wood,  // poles
  wire,
  lamp,
  carPaint,
  carGlass,
  rubber
};

// What people would call the thing that a surface belongs to.
enum class SurfaceClass : uint8_t {
  ground,  // streets, pavements, lawns, the country
  facade,  // also gables, balconies, chimneys
  roof,    // with parapets and what stands on it
  tree,
  water,
  wire,  // wires, their poles, and street lamps
  car
};
inline constexpr int kSurfaceClasses = 7;
SurfaceClass classOfMaterial(Material material);

// The object that a face belongs to. Each wall is an object of its own, because its size determines where windows are.
struct SurfaceObject {
  uint32_t seed = 0;
  Vec3f colour{0.5f, 0.5f, 0.5f};
  float width = 1, height = 1;  // of the wall or roof, metres
  float groundHeight = 3.5f, floorHeight = 3;
  int floors = 1;
  uint32_t block = 0;  // of a block top: index into the layout
  uint8_t style = 0;   // FacadeStyle, or a variant of the material
  bool shops = false;
  Vec3f centre{0, 0, 0};  // of a tree's crown
};

struct SurfaceFace {
  uint32_t a = 0, b = 0, c = 0;
  uint32_t object = 0;
  Material material = Material::plain;
};

struct SurfaceMesh {
  std::vector<Vec3f> positions;
  std::vector<Vec2f> textureAt;
  std::vector<SurfaceFace> faces;
  std::vector<SurfaceObject> objects;

  // Foliage: square cards with four corners each, cut out by the tracer. `leafObjects` has one entry for each card.
  std::vector<Vec3f> leafCorners;
  std::vector<uint32_t> leafObjects;

  uint32_t addObject(const SurfaceObject& object);
  uint32_t addVertex(const Vec3f& p, const Vec2f& uv);
  void addTriangle(const Vec3f& a, const Vec3f& b, const Vec3f& c, Material material, uint32_t object);
  // Corners are counter-clockwise seen from outside; texture (0,0) is at `a`, u along a→b, v along a→d, in metres from
  // `uv`.
  void addQuad(const Vec3f& a, const Vec3f& b, const Vec3f& c, const Vec3f& d, Material material, uint32_t object,
               Vec2f uv = {0, 0});
  // Adds a box without its lower face, standing at `foot` (the centre of that face) and turned by `yaw`.
  void addBox(const Vec3f& foot, const Vec3f& size, float yaw, Material material, uint32_t object);
  // Adds a thin tube between two points.
  void addTube(const Vec3f& from, const Vec3f& to, float radiusFrom, float radiusTo, int sides, Material material,
               uint32_t object);
  void addLeafCard(const Vec3f& centre, const Vec3f& right, const Vec3f& up, uint32_t object);
};

}  // namespace tessera

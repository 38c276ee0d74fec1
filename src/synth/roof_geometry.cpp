#include "synth/city_geometry.h"

namespace tessera {
namespace {

Vec3f at(const Building& b, float x, float y, float z) {
  const Vec2f p = b.place(x, y);
  return {p.x(), p.y(), z};
}

void addPitchedRoof(const Building& b, SurfaceMesh& mesh, RandomSequence& random) {
  const float z = b.base + b.height(), out = 0.45f, rise = b.halfY * random.between(0.62f, 0.85f);
  static constexpr float kTiles[5][3] = {{0.38f, 0.14f, 0.08f},
                                         {0.45f, 0.20f, 0.11f},
                                         {0.17f, 0.17f, 0.18f},
                                         {0.28f, 0.16f, 0.11f},
                                         {0.24f, 0.22f, 0.21f}};
  const float* tile = kTiles[random.below(5)];
  SurfaceObject look;
  look.seed = random.seed();
  look.colour = {tile[0], tile[1], tile[2]};
  look.width = 2 * b.halfX;
  look.height = std::hypot(b.halfY, rise);
  look.shops = b.floors > 1 && random.chance(0.6f);  // roof windows
  const uint32_t object = mesh.addObject(look);
  const float slope = rise / b.halfY, eaves = z - out * slope, y = b.halfY + out;
  const float x = b.halfX + (b.roof == RoofStyle::hip || b.style == FacadeStyle::house ? out : 0);
  const float ridge = b.roof == RoofStyle::hip ? std::max(0.5f, b.halfX - b.halfY) : x;
  const Vec3f sw = at(b, -x, -y, eaves), se = at(b, x, -y, eaves), ne = at(b, x, y, eaves), nw = at(b, -x, y, eaves);
  const Vec3f west = at(b, -ridge, 0, z + rise), east = at(b, ridge, 0, z + rise);
  mesh.addQuad(sw, se, east, west, Material::tileRoof, object);
  mesh.addQuad(ne, nw, west, east, Material::tileRoof, object);
  if (b.roof == RoofStyle::hip) {
    mesh.addTriangle(se, ne, east, Material::tileRoof, object);
    mesh.addTriangle(nw, sw, west, Material::tileRoof, object);
  } else {
    const uint32_t wall = mesh.addObject({.seed = b.seed, .colour = b.colour});
    mesh.addTriangle(at(b, b.halfX, -b.halfY, z), at(b, b.halfX, b.halfY, z), at(b, b.halfX, 0, z + rise),
                     Material::plain, wall);
    mesh.addTriangle(at(b, -b.halfX, b.halfY, z), at(b, -b.halfX, -b.halfY, z), at(b, -b.halfX, 0, z + rise),
                     Material::plain, wall);
  }
  const uint32_t brick = mesh.addObject({.seed = b.seed, .colour = {0.33f, 0.17f, 0.12f}});
  for (int i = 0, n = 1 + random.below(2); i < n; ++i) {
    const float cy = random.between(-0.4f, 0.4f) * b.halfY;
    const Vec3f foot = at(b, random.between(-0.7f, 0.7f) * ridge, cy, z + rise * (1 - std::abs(cy) / b.halfY) - 0.8f);
    mesh.addBox(foot, {0.7f, 0.7f, 2.1f}, b.yaw, Material::plain, brick);
  }
}

void addPlant(const Building& b, float deck, SurfaceMesh& mesh, RandomSequence& random) {
  const float x = (b.corners == 4 ? 0.8f : 0.55f) * b.halfX, y = (b.corners == 4 ? 0.75f : 0.5f) * b.halfY;
  const uint32_t stair = mesh.addObject({.seed = random.seed(), .colour = b.colour * 0.8f + Vec3f(0.1f, 0.1f, 0.1f)});
  const float sx = random.between(-0.5f, 0.5f) * x;
  mesh.addBox(at(b, sx, 0.35f * y, deck), {3.4f, 2.8f, 2.6f}, b.yaw, Material::plain, stair);
  const int style = random.below(3);
  if (style == 0) {  // rows of solar panels, tilted south
    const uint32_t panel = mesh.addObject({.seed = random.seed(), .colour = {0.02f, 0.035f, 0.09f}});
    for (float px = -x; px + 2 < x; px += 2.15f) {
      for (float py = -y; py + 1.6f < y; py += 2.3f) {
        if (std::abs(px + 1 - sx) < 3.2f && py + 1 > -0.3f * y) continue;
        mesh.addQuad(at(b, px, py, deck + 0.25f), at(b, px + 2, py, deck + 0.25f),
                     at(b, px + 2, py + 1.45f, deck + 0.95f), at(b, px, py + 1.45f, deck + 0.95f), Material::solarPanel,
                     panel);
      }
    }
    return;
  }
  for (int i = 0, n = 2 + random.below(4); i < n; ++i) {
    const uint32_t box =
        mesh.addObject({.seed = random.seed(), .colour = Vec3f::Constant(random.between(0.45f, 0.7f))});
    const Vec3f size(random.between(1.2f, 3), random.between(1.2f, 2.2f), random.between(0.9f, 1.8f));
    mesh.addBox(at(b, random.between(-1, 1) * x, random.between(-1, 0.1f) * y, deck), size, b.yaw, Material::vents,
                box);
  }
  if (style == 1) {
    const uint32_t glass = mesh.addObject({.seed = random.seed(), .colour = {0.25f, 0.32f, 0.35f}});
    for (float px = -0.8f * x; px + 1.4f < x; px += 3.2f)
      mesh.addBox(at(b, px + 0.7f, -0.8f * y, deck), {1.5f, 1.5f, 0.35f}, b.yaw, Material::skylight, glass);
  }
  const uint32_t duct = mesh.addObject({.seed = random.seed(), .colour = {0.6f, 0.61f, 0.62f}});
  mesh.addBox(at(b, 0, -0.55f * y, deck + 0.15f), {1.5f * x, 0.5f, 0.5f}, b.yaw, Material::metal, duct);
  if (b.floors > 5) {
    const Vec3f foot = at(b, sx, 0.35f * y, deck + 2.4f);
    mesh.addTube(foot, foot + Vec3f(0, 0, 5.5f), 0.08f, 0.04f, 5, Material::metal, duct);
  }
}

void addFlatRoof(const Building& b, SurfaceMesh& mesh, RandomSequence& random) {
  const float rim = b.base + b.height() + 0.7f, deck = rim - 0.75f, thick = 0.32f;
  const std::vector<Vec2f> outline = b.outline();
  std::vector<Vec2f> inner;
  for (const Vec2f& p : outline) {
    const Vec2f out = p - b.centre;
    const float shrink = b.corners == 4 ? 1.f : 1 - thick / std::min(b.halfX, b.halfY);
    inner.push_back(b.centre + out * shrink);
  }
  if (b.corners == 4) {
    Building smaller = b;
    smaller.halfX -= thick;
    smaller.halfY -= thick;
    inner = smaller.outline();
  }
  static constexpr float kDecks[4][3] = {
      {0.42f, 0.41f, 0.39f}, {0.26f, 0.26f, 0.27f}, {0.60f, 0.59f, 0.57f}, {0.48f, 0.43f, 0.37f}};
  const float* tint = kDecks[random.below(4)];
  SurfaceObject look;
  look.seed = random.seed();
  look.colour = {tint[0], tint[1], tint[2]};
  look.style = random.chance(0.18f) ? 1 : 0;  // planted
  const uint32_t object = mesh.addObject(look);
  const bool glass = b.style == FacadeStyle::curtain;
  const uint32_t cap = mesh.addObject(
      {.seed = b.seed,
       .colour = glass ? Vec3f(0.35f, 0.37f, 0.38f) : Vec3f(b.colour * 0.7f + Vec3f(0.15f, 0.15f, 0.15f))});
  const size_t n = outline.size();
  const auto lift = [](const Vec2f& p, float z) { return Vec3f(p.x(), p.y(), z); };
  for (size_t i = 0; i < n; ++i) {
    const size_t j = (i + 1) % n;
    mesh.addQuad(lift(outline[i], rim), lift(outline[j], rim), lift(inner[j], rim), lift(inner[i], rim),
                 Material::parapet, cap);
    mesh.addQuad(lift(inner[j], deck), lift(inner[i], deck), lift(inner[i], rim), lift(inner[j], rim),
                 Material::parapet, cap);
  }
  // The deck's texture uses the building's own axes.
  const uint32_t first = static_cast<uint32_t>(mesh.positions.size());
  const float c = std::cos(b.yaw), s = std::sin(b.yaw);
  for (const Vec2f& p : inner) {
    const Vec2f d = p - b.centre;
    mesh.addVertex(lift(p, deck), {c * d.x() + s * d.y(), -s * d.x() + c * d.y()});
  }
  for (uint32_t i = 1; i + 1 < n; ++i)
    mesh.faces.push_back({first, first + i, first + i + 1, object, Material::flatRoof});
  addPlant(b, deck, mesh, random);
}

}  // namespace

void addRoof(const Building& b, SurfaceMesh& mesh) {
  RandomSequence random(b.seed ^ 0x600fu);
  if (b.roof == RoofStyle::flat) {
    addFlatRoof(b, mesh, random);
  } else {
    addPitchedRoof(b, mesh, random);
  }
}

}  // namespace tessera

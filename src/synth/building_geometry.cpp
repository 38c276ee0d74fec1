#include "synth/city_geometry.h"

namespace tessera {
namespace {

struct Wall {
  Vec3f a, b;  // along the foot, counter-clockwise around the building
  Vec3f outward;
  float length = 0;
};

void addBalconies(const Building& b, const Wall& wall, const SurfaceObject& look, SurfaceMesh& mesh,
                  RandomSequence& random) {
  const float bay = bayWidth(wall.length, b.style);
  const int bays = static_cast<int>(std::round(wall.length / bay));
  if (bays < 2) return;
  const Vec3f along = (wall.b - wall.a) / wall.length;
  const uint32_t slab = mesh.addObject({.seed = look.seed, .colour = {0.62f, 0.61f, 0.58f}});
  const Vec3f tint = random.chance(0.5f) ? Vec3f(0.7f, 0.7f, 0.68f) : Vec3f(0.25f, 0.32f, 0.36f);
  const uint32_t rail = mesh.addObject({.seed = look.seed + 1, .colour = tint});
  const int every = b.style == FacadeStyle::panel ? 2 : 3, offset = random.below(every);
  const float yaw = std::atan2(along.y(), along.x());
  for (int floor = 1; floor < b.floors; ++floor) {
    const float z = b.base + b.groundHeight + b.floorHeight * static_cast<float>(floor - 1);
    for (int i = offset; i < bays; i += every) {
      const float at = bay * (static_cast<float>(i) + 0.5f), width = bay - 0.5f, deep = 1.3f;
      Vec3f foot = wall.a + along * at + wall.outward * (0.5f * deep);
      foot.z() = z - 0.08f;
      mesh.addBox(foot, {width, deep, 0.16f}, yaw, Material::plain, slab);
      const Vec3f front = wall.outward * (0.5f * deep - 0.03f);
      mesh.addBox(foot + front + Vec3f(0, 0, 0.16f), {width, 0.05f, 0.95f}, yaw, Material::plain, rail);
      for (float side : {-1.f, 1.f})
        mesh.addBox(foot + along * (side * (0.5f * width - 0.03f)) + Vec3f(0, 0, 0.16f), {0.05f, deep, 0.95f}, yaw,
                    Material::plain, rail);
    }
  }
}

void addAwnings(const Building& b, const Wall& wall, SurfaceMesh& mesh, RandomSequence& random) {
  const Vec3f along = (wall.b - wall.a) / wall.length;
  for (float at = 1.2f; at + 4 < wall.length; at += random.between(5, 7.5f)) {
    if (!random.chance(0.6f)) continue;
    const float width = random.between(3, 4.2f);
    static constexpr float kTints[5][3] = {
        {0.6f, 0.08f, 0.07f}, {0.08f, 0.25f, 0.14f}, {0.10f, 0.16f, 0.36f}, {0.75f, 0.5f, 0.1f}, {0.4f, 0.1f, 0.2f}};
    const float* tint = kTints[random.below(5)];
    const uint32_t object = mesh.addObject({.seed = random.seed(), .colour = {tint[0], tint[1], tint[2]}});
    Vec3f p = wall.a + along * at, q = wall.a + along * (at + width);
    p.z() = q.z() = b.base + 3.1f;
    const Vec3f drop = wall.outward * 1.5f - Vec3f(0, 0, 0.7f);
    mesh.addQuad(p + drop, q + drop, q, p, Material::awning, object);
    mesh.addQuad(p + drop - Vec3f(0, 0, 0.2f), q + drop - Vec3f(0, 0, 0.2f), q + drop, p + drop, Material::awning,
                 object);
  }
}

// A ledge round the top and above the ground floor gives walls an edge that catches light.
void addLedge(const Building& b, float z, float out, float high, const Vec3f& colour, SurfaceMesh& mesh) {
  if (b.corners != 4) return;
  const uint32_t object = mesh.addObject({.seed = b.seed, .colour = colour});
  const float x = b.halfX + out, y = b.halfY + out;
  const auto bar = [&](float cx, float cy, float w, float d) {
    const Vec2f c = b.place(cx, cy);
    mesh.addBox({c.x(), c.y(), z}, {w, d, high}, b.yaw, Material::plain, object);
  };
  bar(0, -y + 0.5f * out, 2 * x, out);
  bar(0, y - 0.5f * out, 2 * x, out);
  bar(-x + 0.5f * out, 0, out, 2 * y);
  bar(x - 0.5f * out, 0, out, 2 * y);
}

}  // namespace

void addBuilding(const Building& b, SurfaceMesh& mesh) {
  RandomSequence random(b.seed);
  const std::vector<Vec2f> outline = b.outline();
  const float top = b.base + b.height() + (b.roof == RoofStyle::flat ? 0.7f : 0.f);
  const bool balconies = b.style == FacadeStyle::panel || (b.style == FacadeStyle::plaster && random.chance(0.5f));
  const bool awnings = b.shops && random.chance(0.7f);
  for (size_t i = 0; i < outline.size(); ++i) {
    const Vec2f p = outline[i], q = outline[(i + 1) % outline.size()];
    Wall wall{{p.x(), p.y(), b.base}, {q.x(), q.y(), b.base}, {}, (q - p).norm()};
    wall.outward = Vec3f(q.y() - p.y(), p.x() - q.x(), 0) / wall.length;
    SurfaceObject look;
    look.seed = b.seed + 17u * static_cast<uint32_t>(i);
    look.colour = b.colour;
    look.width = wall.length;
    look.height = top - b.base;
    look.groundHeight = b.groundHeight;
    look.floorHeight = b.floorHeight;
    look.floors = b.floors;
    look.style = static_cast<uint8_t>(b.style);
    look.shops = b.shops && i % 2 == 0;
    const uint32_t object = mesh.addObject(look);
    const Vec3f deep(0, 0, 3);  // the wall goes on underground
    mesh.addQuad(wall.a - deep, wall.b - deep, {q.x(), q.y(), top}, {p.x(), p.y(), top}, Material::facade, object,
                 {0, -3});
    if (b.corners != 4 || b.floors < 2) continue;
    if (balconies && (i == 0 || i == 2)) addBalconies(b, wall, look, mesh, random);
    if (awnings && i == 0) addAwnings(b, wall, mesh, random);
  }
  const bool old = b.style == FacadeStyle::plaster || b.style == FacadeStyle::brick || b.style == FacadeStyle::loft;
  if (old && b.floors > 2) {
    const Vec3f stone = b.style == FacadeStyle::plaster ? Vec3f(b.colour * 1.12f) : Vec3f(0.58f, 0.54f, 0.46f);
    addLedge(b, b.base + b.groundHeight - 0.15f, 0.14f, 0.25f, stone, mesh);
    addLedge(b, b.base + b.height() - 0.35f, 0.28f, 0.4f, stone, mesh);
  }
  addRoof(b, mesh);
}

}  // namespace tessera

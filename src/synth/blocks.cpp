// Plans what stands on a block: buildings, trees and ponds, depending on its kind.
#include <array>
#include <numbers>

#include "synth/layout.h"

namespace tessera {
namespace {

constexpr float kQuarterTurn = 0.5f * std::numbers::pi_v<float>;

Vec3f wallColour(FacadeStyle style, RandomSequence& random) {
  static const std::array<Vec3f, 4> kBrick{
      {{0.42f, 0.17f, 0.11f}, {0.52f, 0.28f, 0.18f}, {0.56f, 0.42f, 0.29f}, {0.33f, 0.15f, 0.12f}}};
  static const std::array<Vec3f, 6> kPlaster{{{0.72f, 0.58f, 0.36f},
                                              {0.75f, 0.70f, 0.60f},
                                              {0.66f, 0.42f, 0.30f},
                                              {0.50f, 0.58f, 0.52f},
                                              {0.70f, 0.63f, 0.47f},
                                              {0.47f, 0.52f, 0.60f}}};
  static const std::array<Vec3f, 4> kConcrete{
      {{0.50f, 0.49f, 0.46f}, {0.62f, 0.60f, 0.55f}, {0.40f, 0.41f, 0.42f}, {0.66f, 0.63f, 0.60f}}};
  static const std::array<Vec3f, 3> kGlass{{{0.05f, 0.10f, 0.13f}, {0.04f, 0.07f, 0.11f}, {0.06f, 0.11f, 0.10f}}};
  Vec3f c;
  switch (style) {
    case FacadeStyle::brick:
    case FacadeStyle::loft:
      c = kBrick[random.below(4)];
      break;
    case FacadeStyle::office:
    case FacadeStyle::panel:
      c = kConcrete[random.below(4)];
      break;
    case FacadeStyle::curtain:
      return kGlass[random.below(3)];
    default:
      c = kPlaster[random.below(6)];
      break;
  }
  return c * random.between(0.85f, 1.1f);
}

// Returns the lowest ground under a building: walls reach deeper, so that none floats on a slope.
float baseUnder(const CityLayout& city, const Building& b) {
  float lowest = city.ground(b.centre.x(), b.centre.y());
  for (const Vec2f& p : b.outline()) lowest = std::min(lowest, city.ground(p.x(), p.y()));
  return lowest;
}

void finish(CityLayout& city, Building b, RandomSequence& random) {
  b.colour = wallColour(b.style, random);
  b.seed = random.seed();
  if (b.style == FacadeStyle::curtain || b.style == FacadeStyle::office) b.floorHeight = 3.5f;
  if (b.style == FacadeStyle::house) b.groundHeight = b.floorHeight = 2.8f;
  if (b.style == FacadeStyle::loft) b.floorHeight = 3.8f;
  b.base = baseUnder(city, b);
  city.buildings.push_back(b);
}

// A closed edge of attached houses of different ages around a green yard.
void planPerimeter(CityLayout& city, const Block& block, RandomSequence& random) {
  const Rect lot = block.area.inset(kPavementWidth);
  const float deep = 11.5f;
  constexpr FacadeStyle kStyles[] = {FacadeStyle::brick, FacadeStyle::plaster, FacadeStyle::plaster,
                                     FacadeStyle::panel, FacadeStyle::office,  FacadeStyle::loft};
  for (int side = 0; side < 4; ++side) {
    const bool alongX = side < 2;
    const float from = alongX ? lot.x0 : lot.y0 + deep, to = alongX ? lot.x1 : lot.y1 - deep;
    const float middle = side == 0   ? lot.y0 + deep / 2
                         : side == 1 ? lot.y1 - deep / 2
                         : side == 2 ? lot.x0 + deep / 2
                                     : lot.x1 - deep / 2;
    const int lots = std::max(1, static_cast<int>((to - from) / random.between(13, 18)));
    const int gap = lots > 2 && random.chance(0.7f) ? 1 + random.below(lots - 2) : -1;
    for (int i = 0; i < lots; ++i) {
      if (i == gap) continue;
      const float a = mix(from, to, static_cast<float>(i) / lots), b = mix(from, to, static_cast<float>(i + 1) / lots);
      const float along = 0.5f * (a + b);
      Building house;
      house.centre = alongX ? Vec2f(along, middle) : Vec2f(middle, along);
      // The local x axis runs along the street with its front (-y) outwards.
      house.yaw = side == 0 ? 0 : side == 1 ? 2 * kQuarterTurn : side == 2 ? -kQuarterTurn : kQuarterTurn;
      house.halfX = 0.5f * (b - a) - 0.02f;
      house.halfY = 0.5f * deep;
      house.floors = 3 + random.below(4);
      house.style = kStyles[random.below(6)];
      const bool old = house.style == FacadeStyle::brick || house.style == FacadeStyle::plaster;
      house.roof = old && random.chance(0.65f) ? RoofStyle::gable : RoofStyle::flat;
      house.shops = random.chance(0.6f);
      finish(city, house, random);
    }
  }
  const Rect yard = lot.inset(deep + 4);
  const int trees = static_cast<int>(std::max(0.f, yard.width() * yard.depth()) / 75);
  for (int i = 0; i < trees; ++i)
    city.trees.push_back({{random.between(yard.x0, yard.x1), random.between(yard.y0, yard.y1)},
                          random.between(6, 11),
                          random.between(2.2f, 3.6f),
                          false,
                          320,
                          random.seed()});
}

// Glass and concrete towers on a paved square with a pool.
void planTowers(CityLayout& city, Block& block, RandomSequence& random) {
  const Rect lot = block.area.inset(kPavementWidth + 2.5f);
  const Vec2f c = lot.centre();
  const float w = lot.width(), d = lot.depth();
  const bool flip = random.chance(0.5f);
  const float side = flip ? -1.f : 1.f;

  Building glass;
  glass.centre = {c.x() - side * 0.27f * w, c.y() + 0.18f * d};
  glass.halfX = 11;
  glass.halfY = 10;
  glass.yaw = random.between(-0.3f, 0.3f);
  glass.floors = 10 + random.below(3);
  glass.style = FacadeStyle::curtain;
  glass.corners = random.chance(0.45f) ? 8 : 4;
  finish(city, glass, random);

  Building slab;
  slab.centre = {c.x() + side * 0.28f * w, c.y() - 0.24f * d};
  slab.halfX = 0.19f * w;
  slab.halfY = 6.5f;
  slab.floors = 6 + random.below(4);
  slab.style = random.chance(0.5f) ? FacadeStyle::panel : FacadeStyle::office;
  finish(city, slab, random);

  Building low;
  low.centre = {c.x() + side * 0.24f * w, c.y() + 0.30f * d};
  low.halfX = 0.22f * w;
  low.halfY = 0.13f * d;
  low.floors = 2 + random.below(2);
  low.style = FacadeStyle::curtain;
  finish(city, low, random);

  Pond pool;
  pool.centre = {c.x() - side * 0.24f * w, c.y() - 0.30f * d};
  pool.radiusX = 0.16f * w;
  pool.radiusY = 0.12f * d;
  pool.level = city.terrain(pool.centre.x(), pool.centre.y()) - 0.25f;
  block.ponds.push_back(pool);

  for (float x = lot.x0 + 4; x < lot.x1 - 3; x += 8.5f) {
    const Vec2f foot(x, c.y() + 0.02f * d);
    if (city.highestNear(foot.x(), foot.y(), -1.5f) > city.terrain(foot.x(), foot.y()) + 1) continue;
    city.trees.push_back({foot, random.between(5.5f, 7.5f), random.between(1.7f, 2.2f), false, 240, random.seed()});
  }
}

void planPark(CityLayout& city, Block& block, RandomSequence& random) {
  const Rect lawn = block.area.inset(kPavementWidth + 2);
  Pond pond;
  pond.centre =
      lawn.centre() + Vec2f(random.between(-0.12f, 0.12f) * lawn.width(), random.between(-0.1f, 0.1f) * lawn.depth());
  pond.radiusX = 0.25f * lawn.width();
  pond.radiusY = 0.23f * lawn.depth();
  pond.level = 1e9f;
  for (int i = 0; i < 16; ++i) {
    const float a = 0.25f * kQuarterTurn * static_cast<float>(i);
    pond.level = std::min(pond.level, city.terrain(pond.centre.x() + pond.radiusX * std::cos(a),
                                                   pond.centre.y() + pond.radiusY * std::sin(a)) -
                                          0.3f);
  }
  block.ponds.push_back(pond);
  Building kiosk;
  kiosk.centre = {lawn.x0 + 9, lawn.y1 - 8};
  kiosk.halfX = 4.5f;
  kiosk.halfY = 3.2f;
  kiosk.floors = 1;
  kiosk.style = FacadeStyle::house;
  kiosk.roof = RoofStyle::hip;
  finish(city, kiosk, random);
  const int trees = static_cast<int>(lawn.width() * lawn.depth() / 62);
  for (int i = 0; i < trees; ++i) {
    const Vec2f foot(random.between(lawn.x0, lawn.x1), random.between(lawn.y0, lawn.y1));
    const bool conifer = random.chance(0.22f);
    const float height = conifer ? random.between(8, 14) : random.between(6, 13);
    const float radius = conifer ? random.between(1.7f, 2.5f) : height * random.between(0.26f, 0.36f);
    const uint32_t seed = random.seed();
    if (pond.reach(foot.x(), foot.y()) < 1.5f || (foot - kiosk.centre).norm() < 6 + radius) continue;
    city.trees.push_back({foot, height, radius, conifer, 360, seed});
  }
}

// Two rows of detached houses with gardens.
void planHouses(CityLayout& city, const Block& block, RandomSequence& random) {
  const Rect lot = block.area.inset(kPavementWidth);
  const int perRow = std::max(2, static_cast<int>(lot.width() / 17));
  for (int row = 0; row < 2; ++row) {
    for (int i = 0; i < perRow; ++i) {
      const float plot = lot.width() / static_cast<float>(perRow);
      const float x = lot.x0 + plot * (static_cast<float>(i) + 0.5f);
      const float y = row == 0 ? lot.y0 + 11.5f : lot.y1 - 11.5f;
      Building house;
      house.centre = {x + random.between(-1, 1), y + random.between(-1.5f, 1.5f)};
      house.yaw =
          (row == 0 ? 0 : 2 * kQuarterTurn) + random.between(-0.06f, 0.06f) + (random.chance(0.35f) ? kQuarterTurn : 0);
      house.halfX = random.between(4.6f, 5.6f);
      house.halfY = random.between(4, 4.8f);
      house.floors = 1 + random.below(2);
      house.style = random.chance(0.3f) ? FacadeStyle::brick : FacadeStyle::house;
      house.roof = random.chance(0.65f) ? RoofStyle::gable : RoofStyle::hip;
      house.floorHeight = house.groundHeight = 2.8f;
      finish(city, house, random);
      for (int t = 0; t < 3; ++t) {
        const float side = random.chance(0.5f) ? 1.f : -1.f;
        const Vec2f foot(x + side * random.between(0.3f, 0.46f) * plot,
                         row == 0 ? y + random.between(8, 14) : y - random.between(8, 14));
        const bool conifer = random.chance(0.2f);
        city.trees.push_back({foot, random.between(4.5f, 9), random.between(1.4f, 2.8f), conifer, 260, random.seed()});
      }
    }
  }
}

}  // namespace

void planBlock(CityLayout& city, Block& block) {
  RandomSequence random(block.seed);
  switch (block.kind) {
    case BlockKind::perimeter:
      planPerimeter(city, block, random);
      break;
    case BlockKind::towers:
      planTowers(city, block, random);
      break;
    case BlockKind::park:
      planPark(city, block, random);
      break;
    case BlockKind::houses:
      planHouses(city, block, random);
      break;
  }
}

void planEnvirons(CityLayout& city) {
  RandomSequence random(city.seed ^ 0x5a5a5a5au);
  const float reach = 170;
  const Rect outer = city.area.inset(-reach);
  const auto onStreet = [&](Vec2f p, float margin) {
    for (const Street& s : city.alongY)
      if (std::abs(p.x() - s.centre) < s.width / 2 + margin) return true;
    for (const Street& s : city.alongX)
      if (std::abs(p.y() - s.centre) < s.width / 2 + margin) return true;
    return false;
  };
  const float ringArea = outer.width() * outer.depth() - city.area.width() * city.area.depth();
  const int houses = static_cast<int>(ringArea / 700), trees = static_cast<int>(ringArea / 120);
  for (int i = 0; i < houses; ++i) {
    const Vec2f p(random.between(outer.x0, outer.x1), random.between(outer.y0, outer.y1));
    Building house;
    house.centre = p;
    house.yaw = kQuarterTurn * static_cast<float>(random.below(4)) + random.between(-0.1f, 0.1f);
    house.halfX = random.between(5, 8);
    house.halfY = random.between(4, 5.2f);
    house.floors = 1 + random.below(2);
    house.style = FacadeStyle::house;
    house.roof = random.chance(0.7f) ? RoofStyle::gable : RoofStyle::hip;
    const float near = -city.area.inside(p.x(), p.y());
    if (near < 16 || near > 130 || onStreet(p, 11) || city.highestNear(p.x(), p.y(), 11) > city.terrain(p.x(), p.y()))
      continue;
    finish(city, house, random);
  }
  // An avenue along the edge of the town, where no power line stands.
  const float west = city.area.x0 - 3.4f, north = city.area.y1 + 3.4f;
  const auto avenue = [&](const Vec2f& p) {
    if (random.chance(0.8f) && !onStreet(p, 2))
      city.trees.push_back({p, random.between(7, 11), random.between(2.2f, 3), false, 220, random.seed()});
  };
  for (float s = city.area.x0; s < city.area.x1; s += random.between(9, 13)) avenue({s, north});
  for (float s = city.area.y0; s < city.area.y1; s += random.between(9, 13)) avenue({west, s});
  for (int i = 0; i < trees; ++i) {
    const Vec2f p(random.between(outer.x0, outer.x1), random.between(outer.y0, outer.y1));
    const float grove = valueNoise(p.x() / 45, p.y() / 45, city.seed ^ 0x77u);
    const uint32_t seed = random.seed();
    const float height = random.between(5, 11);
    if (-city.area.inside(p.x(), p.y()) < 6 || grove < random.between(-0.8f, 0.7f) || onStreet(p, 3) ||
        city.highestNear(p.x(), p.y(), 2) > city.terrain(p.x(), p.y()))
      continue;
    city.trees.push_back({p, height, height * 0.33f, seed % 4 == 0, 130, seed});
  }
}

}  // namespace tessera

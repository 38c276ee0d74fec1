#include "synth/layout.h"

#include <algorithm>
#include <numbers>

#include "base/random.h"

namespace tessera {

Vec2f Building::place(float x, float y) const {
  const float c = std::cos(yaw), s = std::sin(yaw);
  return {centre.x() + c * x - s * y, centre.y() + s * x + c * y};
}

std::vector<Vec2f> Building::outline() const {
  std::vector<Vec2f> points;
  if (corners == 4) return {place(-halfX, -halfY), place(halfX, -halfY), place(halfX, halfY), place(-halfX, halfY)};
  for (int i = 0; i < corners; ++i) {
    const float angle = 2 * std::numbers::pi_v<float> * (static_cast<float>(i) + 0.5f) / static_cast<float>(corners);
    points.push_back(place(halfX * std::cos(angle), halfY * std::sin(angle)));
  }
  return points;
}

float bayWidth(float wallLength, FacadeStyle style) {
  const float targetWidth = style == FacadeStyle::loft ? 4.2f : style == FacadeStyle::panel ? 3.6f : 3.1f;
  return wallLength / std::max(1.f, std::round(wallLength / targetWidth));
}

float Pond::reach(float x, float y) const {
  const float dx = (x - centre.x()) / radiusX, dy = (y - centre.y()) / radiusY;
  const float angle = std::atan2(dy, dx);
  return std::sqrt(dx * dx + dy * dy) / (1 + 0.13f * std::sin(3 * angle + 1) + 0.07f * std::sin(5 * angle));
}

float CityLayout::terrain(float x, float y) const {
  const float outside = -std::min(0.f, area.inside(x, y));
  const float gentle =
      1.8f * valueNoise(x / 90, y / 90, seed ^ 0x11u) + 0.25f * valueNoise(x / 23, y / 23, seed ^ 0x12u);
  const float hills =
      26 * (0.6f + valueNoise(x / 420, y / 420, seed ^ 0x13u)) + 7 * valueNoise(x / 150, y / 150, seed ^ 0x14u);
  return gentle + smoothStep(60, 900, outside) * hills;
}

Vec3f CityLayout::terrainNormal(float x, float y) const {
  const float e = 1.5f;
  const float dx = (terrain(x + e, y) - terrain(x - e, y)) / (2 * e);
  const float dy = (terrain(x, y + e) - terrain(x, y - e)) / (2 * e);
  return Vec3f(-dx, -dy, 1).normalized();
}

const Block* CityLayout::blockAt(float x, float y) const {
  for (const Block& block : blocks)
    if (block.area.contains(x, y)) return &block;
  return nullptr;
}

float CityLayout::ground(float x, float y) const {
  float z = terrain(x, y);
  if (const Block* block = blockAt(x, y)) {
    z += kKerbHeight;
    for (const Pond& pond : block->ponds) {
      const float shore = smoothStep(1.35f, 0.75f, pond.reach(x, y));
      z = mix(z, pond.level - 1.2f, shore);
    }
  }
  return z;
}

float CityLayout::highestNear(float x, float y, float radius) const {
  float highest = terrain(x, y);
  for (const Building& b : buildings) {
    const float extent = std::hypot(b.halfX, b.halfY) + radius;
    if ((b.centre - Vec2f(x, y)).norm() < extent) highest = std::max(highest, b.base + b.height() + 6);
  }
  return highest;
}

namespace {

// Street trees, lamps and parked cars along the kerb of one block's side.
void furnishKerb(CityLayout& city, const Block& block, RandomSequence& random) {
  const Rect& a = block.area;
  for (int side = 0; side < 4; ++side) {
    const bool alongX = side < 2;
    const float from = alongX ? a.x0 : a.y0, to = alongX ? a.x1 : a.y1;
    const float kerb = side == 0 ? a.y0 : side == 1 ? a.y1 : side == 2 ? a.x0 : a.x1;
    const float inward = side == 0 || side == 2 ? 1.f : -1.f;
    const auto at = [&](float along, float in) {
      return alongX ? Vec2f(along, kerb + inward * in) : Vec2f(kerb + inward * in, along);
    };
    const bool trees = random.chance(0.75f);
    for (float s = from + 9; s < to - 8; s += random.between(8.5f, 11)) {
      if (trees && random.chance(0.8f))
        city.trees.push_back(
            {at(s, 1.1f), random.between(6, 9.5f), random.between(1.8f, 2.7f), false, 260, random.seed()});
    }
    for (float s = from + 4.5f; s < to - 4; s += 21) city.lamps.push_back({at(s, 0.6f), 6.5f, false});
    for (float s = from + 11; s < to - 11; s += 5.6f) {
      if (!random.chance(0.42f)) continue;
      const float yaw =
          (alongX ? 0.f : 0.5f * std::numbers::pi_v<float>)+(random.chance(0.5f) ? std::numbers::pi_v<float> : 0);
      city.parkedCars.push_back({at(s, -1.15f), yaw, random.seed()});
    }
  }
}

// Wooden poles with wires along the southern and western street of the city and out into the country.
void planPoles(CityLayout& city) {
  const float y = city.alongX.front().centre - 0.5f * city.alongX.front().width - 2.2f;
  const float x = city.alongY.back().centre + 0.5f * city.alongY.back().width + 2.2f;
  for (int line = 0; line < 2; ++line) {
    const float from = (line == 0 ? city.area.x0 : city.area.y0) - 140,
                to = (line == 0 ? city.area.x1 : city.area.y1) + 140;
    const int spans = std::max(2, static_cast<int>((to - from) / 32));
    for (int i = 0; i <= spans; ++i) {
      const float s = mix(from, to, static_cast<float>(i) / static_cast<float>(spans));
      city.poles.push_back({line == 0 ? Vec2f(s, y) : Vec2f(x, s), 10.5f, i < spans});
    }
  }
}

}  // namespace

CityLayout planCity(int blocksX, int blocksY, uint64_t seed) {
  CityLayout city;
  city.seed = RandomStream(seed, 1).bits32(0);
  RandomSequence random(city.seed);

  const auto lay = [&](int count, float low, float high, std::vector<Street>& streets) {
    std::vector<float> sizes;
    float total = 0;
    for (int i = 0; i <= count; ++i) streets.push_back({0, random.chance(0.3f) ? 17.f : 13.5f});
    for (int i = 0; i < count; ++i) sizes.push_back(random.between(low, high));
    for (const Street& s : streets) total += s.width;
    for (float s : sizes) total += s;
    float at = -0.5f * total;
    for (int i = 0; i <= count; ++i) {
      streets[i].centre = at + 0.5f * streets[i].width;
      at += streets[i].width + (i < count ? sizes[i] : 0);
    }
    return 0.5f * total;
  };
  const float halfX = lay(blocksX, 66, 84, city.alongY), halfY = lay(blocksY, 56, 70, city.alongX);
  city.area = {-halfX, -halfY, halfX, halfY};

  // Every kind appears before one repeats; the seed determines their order.
  const int count = blocksX * blocksY;
  std::vector<BlockKind> kinds;
  for (int i = 0; i < count; ++i) {
    constexpr BlockKind kOrder[] = {BlockKind::perimeter, BlockKind::towers,    BlockKind::park,
                                    BlockKind::houses,    BlockKind::perimeter, BlockKind::towers};
    kinds.push_back(kOrder[i % 6]);
  }
  for (int i = count - 1; i > 0; --i) std::swap(kinds[i], kinds[random.below(i + 1)]);
  for (int j = 0; j < blocksY; ++j) {
    for (int i = 0; i < blocksX; ++i) {
      const Street &west = city.alongY[i], &east = city.alongY[i + 1], &south = city.alongX[j],
                   &north = city.alongX[j + 1];
      Block block;
      block.area = {west.centre + west.width / 2, south.centre + south.width / 2, east.centre - east.width / 2,
                    north.centre - north.width / 2};
      block.kind = kinds[j * blocksX + i];
      block.seed = random.seed();
      city.blocks.push_back(block);
    }
  }
  for (Block& block : city.blocks) {
    planBlock(city, block);
    furnishKerb(city, block, random);
  }
  planPoles(city);
  planEnvirons(city);
  // In a large city, trees have fewer and larger leaves, so that it fits into memory.
  const float leaves = std::clamp(64.f / static_cast<float>(count), 0.15f, 1.f);
  for (Tree& tree : city.trees) tree.leafCards = static_cast<int>(leaves * static_cast<float>(tree.leafCards));
  return city;
}

}  // namespace tessera

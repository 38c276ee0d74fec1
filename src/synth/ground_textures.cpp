#include "synth/surface.h"

namespace tessera {
namespace {

Vec3f asphalt(float x, float y, uint32_t seed, float width) {
  const float grain = fractalNoise(x, y, seed ^ 0xa5u, 0.5f, 4, width),
              stain = fractalNoise(x, y, seed ^ 0xa6u, 11, 3, width);
  // Square repairs, darker than the old surface.
  const int px = floorInt(x / 3.4f), py = floorInt(y / 5.2f);
  const float patch = latticeRandom(px, py, seed ^ 0xa7u) < 0.07f ? 0.72f : 1.f;
  const float value = 0.115f * patch * (1 + 0.16f * grain + 0.22f * stain);
  return {value * 1.02f, value, value * 0.97f};
}

// Returns the colour of a street in its own axes. `across`: distance from the centre line; `toJunction`: distance to
// the edge of the nearest crossing street.
Vec3f streetColour(Vec3f base, float across, float along, float streetWidth, float toJunction, bool town, float width) {
  const Vec3f paint(0.68f, 0.68f, 0.64f);
  const float half = 0.5f * streetWidth;
  // Tyres polish two tracks a lane.
  const float lane = std::abs(std::abs(across) - 0.15f * streetWidth);
  base *= 1 - 0.14f * smoothStep(0.5f, 0.1f, std::abs(lane - 0.75f));
  float mark = 0;
  if (toJunction > 5.6f) mark = covered(across, -0.08f, 0.08f, width) * stripes(along, 6, 3, width);
  if (town) {
    const float zebra = covered(toJunction, 1.0f, 3.6f, width) * covered(std::abs(across), 0, half - 0.7f, width);
    mark = std::max(mark, zebra * stripes(across + 20, 1.1f, 0.55f, width));
    mark = std::max(mark, covered(toJunction, 4.6f, 5.0f, width) * covered(std::abs(across), 0.1f, half - 2.4f, width));
    const float bay = half - 2.25f;
    const float parking = covered(toJunction, 7, 1e4f, width);
    mark = std::max(mark, parking * covered(std::abs(across), bay - 0.06f, bay + 0.06f, width));
    mark = std::max(mark,
                    0.9f * parking * covered(std::abs(across), bay, half, width) * stripes(along, 5.6f, 0.12f, width));
    // Gutter.
    base *= 1 - 0.3f * covered(std::abs(across), half - 0.25f, half, width);
  } else {
    mark = std::max(mark, covered(std::abs(across), half - 0.5f, half - 0.35f, width));
  }
  const float worn = 0.82f + 0.18f * fractalNoise(across, along, 0x3a, 1.7f, 3, width);
  return mix(base, paint, mark * worn);
}

Vec3f fieldColour(const CityLayout& city, float x, float y, float width) {
  const float wx = x + 18 * valueNoise(x / 130, y / 130, city.seed ^ 0xf1u),
              wy = y + 18 * valueNoise(x / 130, y / 130, city.seed ^ 0xf2u);
  const int fx = floorInt(wx / 118), fy = floorInt(wy / 84);
  const uint32_t kind = latticeHash(fx, fy, city.seed ^ 0xf3u);
  static const Vec3f kCrops[6] = {{0.13f, 0.20f, 0.06f}, {0.36f, 0.30f, 0.13f}, {0.21f, 0.15f, 0.10f},
                                  {0.17f, 0.24f, 0.07f}, {0.28f, 0.29f, 0.10f}, {0.10f, 0.17f, 0.06f}};
  Vec3f colour = kCrops[kind % 6];
  const bool turned = (kind >> 8) % 2 == 0;
  colour *= 0.86f + 0.28f * stripes(turned ? wx : wy, 2.6f, 1.3f, width);
  colour *= 1 + 0.2f * fractalNoise(x, y, city.seed ^ 0xf4u, 26, 5, width);
  const float edge = std::min(std::min(wx - 118 * fx, 118 * (fx + 1) - wx), std::min(wy - 84 * fy, 84 * (fy + 1) - wy));
  return mix(Vec3f(0.08f, 0.13f, 0.04f), colour, smoothStep(0.8f, 2.2f, edge));
}

Vec3f pavement(float x, float y, uint32_t seed, float width) {
  const float slab = latticeRandom(floorInt(x / 0.8f), floorInt(y / 0.8f), seed);
  const float keep = clamped(0.8f / (2 * width) - 0.5f);
  float value =
      0.40f * (1 + 0.16f * keep * (slab - 0.5f)) * (1 + 0.12f * fractalNoise(x, y, seed ^ 0xb1u, 6, 5, width));
  value *= 1 - 0.25f * std::max(stripes(x, 0.8f, 0.04f, width), stripes(y, 0.8f, 0.04f, width));
  return {value * 1.03f, value, value * 0.94f};
}

Vec3f gravel(float x, float y, uint32_t seed, float width) {
  const float value = 0.46f * (1 + 0.12f * fractalNoise(x, y, seed ^ 0xc1u, 3, 5, width));
  return {value, value * 0.9f, value * 0.72f};
}

Vec3f plaza(float x, float y, uint32_t seed, float width) {
  const bool dark = (floorInt(x / 1.5f) + floorInt(y / 1.5f)) % 2 != 0;
  const float keep = clamped(1.5f / (2 * width) - 0.5f);
  float value = 0.43f + (dark ? -0.05f : 0.05f) * keep;
  value *= 1 + 0.1f * fractalNoise(x, y, seed ^ 0xd1u, 5, 4, width);
  const float band = std::max(stripes(x, 9, 0.7f, width), stripes(y, 9, 0.7f, width));
  return mix(Vec3f(value, value * 0.96f, value * 0.9f), Vec3f(0.26f, 0.18f, 0.15f), band);
}

// Flower beds and shrubs: dots of colour in dark green.
Vec3f flowers(float x, float y, uint32_t seed, float width) {
  const float pick = latticeRandom(floorInt(x / 0.33f), floorInt(y / 0.33f), seed);
  static const Vec3f kBlooms[4] = {
      {0.6f, 0.08f, 0.10f}, {0.65f, 0.5f, 0.08f}, {0.45f, 0.2f, 0.5f}, {0.7f, 0.66f, 0.6f}};
  const Vec3f green(0.07f, 0.13f, 0.04f);
  return pick < 0.35f
             ? mix(kBlooms[latticeHash(floorInt(x / 4), floorInt(y / 4), seed) % 4], green, clamped(width - 0.2f))
             : green;
}

}  // namespace

Vec3f grassColour(float x, float y, uint32_t seed, float width) {
  const float broad = fractalNoise(x, y, seed ^ 0xe1u, 14, 3, width),
              fine = fractalNoise(x, y, seed ^ 0xe2u, 1.3f, 4, width);
  const Vec3f fresh(0.085f, 0.130f, 0.042f), dry(0.20f, 0.185f, 0.09f);
  return mix(fresh, dry, clamped(0.3f + 0.75f * broad)) * (1 + 0.32f * fine);
}

Vec3f terrainColour(const CityLayout& city, float x, float y, float width) {
  const Street *v = nullptr, *h = nullptr;
  float toVertical = 1e4f, toHorizontal = 1e4f;  // distance from the nearest street's edge, negative on it
  for (const Street& s : city.alongY) {
    const float d = std::abs(x - s.centre) - 0.5f * s.width;
    if (d < toVertical) toVertical = d, v = &s;
  }
  for (const Street& s : city.alongX) {
    const float d = std::abs(y - s.centre) - 0.5f * s.width;
    if (d < toHorizontal) toHorizontal = d, h = &s;
  }
  const float outside = -city.area.inside(x, y);
  const Vec3f road = asphalt(x, y, city.seed, width);
  if (toVertical < 0 && toHorizontal < 0) return road;
  if (toVertical < 0) return streetColour(road, x - v->centre, y, v->width, toHorizontal, outside < 0, width);
  if (toHorizontal < 0) return streetColour(road, y - h->centre, x, h->width, toVertical, outside < 0, width);
  const float verge = std::min(toVertical, toHorizontal);
  const Vec3f lawn = grassColour(x, y, city.seed, width);
  if (verge < 0.4f) return gravel(x, y, city.seed, width) * 0.7f;
  if (verge < 2.2f) return pavement(x, y, city.seed, width) * 0.9f;
  return mix(lawn, fieldColour(city, x, y, width), smoothStep(95, 150, outside));
}

Vec3f blockTopColour(const Block& block, float x, float y, float width) {
  const Rect& a = block.area;
  const float edge = a.inside(x, y);
  if (edge < 0.3f) return Vec3f(0.5f, 0.49f, 0.47f) * (1 - 0.2f * stripes(x + y, 1, 0.05f, width));
  const Vec2f c = a.centre();
  const uint32_t seed = block.seed;
  if (edge < kPavementWidth) return pavement(x, y, seed, width);
  const Vec3f grass = grassColour(x, y, seed, width);
  const float dx = std::abs(x - c.x()), dy = std::abs(y - c.y());
  float reach = 1e3f;
  for (const Pond& pond : block.ponds) reach = std::min(reach, pond.reach(x, y));
  switch (block.kind) {
    case BlockKind::perimeter: {
      const float yard = edge - kPavementWidth - 11.5f;
      if (yard < 2.2f) return pavement(x + 0.3f, y, seed ^ 5u, width) * Vec3f(0.95f, 0.85f, 0.8f).x();
      if (std::min(dx, dy) < 1.1f) return gravel(x, y, seed, width);
      if (yard < 3.4f) return flowers(x, y, seed, width);
      return grass;
    }
    case BlockKind::towers: {
      if (reach < 1.32f) return Vec3f(0.55f, 0.54f, 0.52f) * (reach < 1.05f ? 0.35f : 1.f);
      const bool bed = std::abs(y - c.y() - 0.02f * a.depth()) < 1.6f && edge > 6 && fraction((x - a.x0) / 17) > 0.25f;
      return bed ? grass : plaza(x, y, seed, width);
    }
    case BlockKind::park: {
      if (reach < 1.22f)
        return mix(Vec3f(0.10f, 0.09f, 0.06f), Vec3f(0.36f, 0.31f, 0.22f), smoothStep(0.95f, 1.15f, reach));
      if (std::abs(reach - 1.62f) < 0.075f || edge < kPavementWidth + 1.6f) return gravel(x, y, seed, width);
      // Paths from the four gates, gently bent.
      const float bend = 3 * std::sin(0.11f * (x + y));
      if (reach > 1.62f && (std::abs(x - c.x() + bend) < 1.2f || std::abs(y - c.y() - bend) < 1.2f))
        return gravel(x, y, seed, width);
      const float play = std::hypot(x - (a.x1 - 13), y - (a.y0 + 12));
      if (play < 6)
        return play < 2.4f ? Vec3f(0.55f, 0.45f, 0.28f)
                           : Vec3f(0.36f, 0.13f, 0.09f) * (1 + 0.08f * fractalNoise(x, y, seed, 2, 3, width));
      if (std::abs(reach - 1.85f) < 0.06f) return flowers(x, y, seed, width);
      return grass * (0.9f + 0.2f * stripes(0.8f * x + 0.6f * y, 4.5f, 2.25f, width));
    }
    case BlockKind::houses: {
      const float plots = std::max(2.f, std::floor((a.width() - 2 * kPavementWidth) / 17));
      const float plot = (a.width() - 2 * kPavementWidth) / plots;
      const float u = fraction((x - a.x0 - kPavementWidth) / plot) * plot;
      const float front = std::min(y - a.y0, a.y1 - y) - kPavementWidth;
      if (std::min(u, plot - u) < 0.5f || dy < 0.6f)
        return Vec3f(0.055f, 0.10f, 0.035f) * (1 + 0.3f * fractalNoise(x, y, seed, 1, 3, width));
      if (u > 0.8f && u < 3.6f && front < 11) return plaza(x, y, seed ^ 3u, width) * 0.8f;
      if (front > 13 && front < 16.5f && u > 4 && u < plot - 4)
        return Vec3f(0.42f, 0.34f, 0.26f) * (1 - 0.15f * stripes(x, 0.3f, 0.04f, width));
      if (latticeRandom(floorInt((x - a.x0) / plot), y > c.y(), seed) < 0.35f && front > 18 && u > 5 && u < 8)
        return flowers(x, y, seed, width);
      return grass;
    }
  }
  return grass;
}

}  // namespace tessera

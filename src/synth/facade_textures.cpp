#include "synth/surface.h"

namespace tessera {
namespace {

// A window or a pane in its own axes: x from its middle, y from its lower edge.
struct Opening {
  float width = 1.2f, height = 1.5f;
  float frame = 0.08f;
  int columns = 2, rows = 1;  // number of panes
  Vec3f frameColour{0.75f, 0.74f, 0.70f};
};

struct Painted {
  Vec3f colour{0, 0, 0};
  float glass = 0;
};

// Returns the colour seen behind a pane: a dark room, a blind drawn to some height, curtains, sometimes a lit ceiling.
Vec3f interior(float x, float y, const Opening& o, uint32_t hash) {
  const float pick = static_cast<float>(hash & 0xffffu) / 65536, shade = static_cast<float>(hash >> 16) / 65536;
  const Vec3f interiorColour = Vec3f(0.055f, 0.06f, 0.065f) * (0.5f + shade);
  if (pick < 0.28f && y > o.height * (0.25f + 0.7f * shade)) return Vec3f(0.52f, 0.50f, 0.45f);
  if (pick > 0.72f && std::abs(x) > o.width * (0.22f + 0.15f * shade)) return Vec3f(0.42f, 0.36f, 0.30f);
  if (pick > 0.66f && pick < 0.70f) return Vec3f(0.50f, 0.42f, 0.25f);
  return interiorColour * (1.3f - 0.5f * y / o.height);
}

// Returns the coverage of the opening at (x, y); `out` receives its appearance there.
float paintOpening(const Opening& o, float x, float y, uint32_t hash, float width, Painted& out) {
  const float half = 0.5f * o.width;
  const float inside = covered(x, -half, half, width) * covered(y, 0, o.height, width);
  if (inside <= 0) return 0;
  float pane = covered(x, -half + o.frame, half - o.frame, width) * covered(y, o.frame, o.height - o.frame, width);
  const float bar = 0.06f, paneWidth = o.width / static_cast<float>(o.columns),
              paneHeight = o.height / static_cast<float>(o.rows);
  if (o.columns > 1) pane *= 1 - stripes(x + half + 0.5f * bar, paneWidth, bar, width);
  if (o.rows > 1) pane *= 1 - stripes(y + 0.5f * bar, paneHeight, bar, width);
  // The reveal casts its own small shadow from above.
  const float shade = 1 - 0.55f * covered(y, o.height - 0.22f, o.height, width);
  out.colour = mix(o.frameColour, interior(x, y, o, hash), pane) * shade;
  out.glass = pane;
  return inside;
}

Vec3f brickwork(const Vec3f& base, float u, float v, uint32_t seed, float width) {
  const int row = floorInt(v / 0.11f);
  const float shifted = u + (row % 2 != 0 ? 0.14f : 0);
  const float keep = clamped(0.11f / (2 * width) - 0.5f);
  const float tone = latticeRandom(floorInt(shifted / 0.28f), row, seed) - 0.5f;
  const float joint = std::max(stripes(v, 0.11f, 0.018f, width), stripes(shifted, 0.28f, 0.018f, width));
  const Vec3f colour = base * (1 + 0.5f * tone * keep + 0.14f * fractalNoise(u, v, seed, 2.2f, 4, width));
  return mix(colour, Vec3f(0.45f, 0.42f, 0.38f), 0.6f * joint);
}

// Rain leaves long vertical streaks, denser below ledges.
float weathering(float u, float v, const SurfaceObject& wall, float width) {
  const float streak = fractalNoise(u * 3, v * 0.25f, wall.seed ^ 0x31u, 1.5f, 4, width);
  const float foot = smoothStep(1.4f, 0, v);
  return 1 + 0.09f * streak + 0.06f * fractalNoise(u, v, wall.seed ^ 0x32u, 5, 3, width) - 0.22f * foot;
}

void paintShops(const SurfaceObject& wall, float u, float v, float width, Surface& s) {
  const float unit = wall.width / std::max(1.f, std::round(wall.width / 5.5f));
  const int shop = floorInt(u / unit);
  const float x = u - unit * (static_cast<float>(shop) + 0.5f);
  const uint32_t hash = latticeHash(shop, 7, wall.seed);
  static const Vec3f kSigns[6] = {{0.5f, 0.06f, 0.06f},  {0.05f, 0.16f, 0.34f}, {0.06f, 0.26f, 0.14f},
                                  {0.08f, 0.08f, 0.09f}, {0.62f, 0.45f, 0.10f}, {0.6f, 0.58f, 0.54f}};
  Opening pane{
      .width = unit - 0.7f, .height = 2.55f, .frame = 0.1f, .columns = 3, .frameColour = Vec3f(0.12f, 0.12f, 0.13f)};
  Painted painted;
  const float share = paintOpening(pane, x, v - 0.35f, hash, width, painted);
  s.albedo = mix(s.albedo, painted.colour, share);
  s.gloss = share * painted.glass;
  const float sign = covered(v, 2.95f, 3.45f, width) * covered(x, -0.5f * unit + 0.25f, 0.5f * unit - 0.25f, width);
  Vec3f board = kSigns[hash % 6];
  const float letters = covered(v, 3.07f, 3.33f, width) * covered(std::abs(x), 0, 0.28f * unit, width);
  if (latticeRandom(floorInt(u / 0.16f), 3, hash) > 0.4f)
    board = mix(board, Vec3f(0.75f, 0.73f, 0.66f), 0.8f * letters);
  s.albedo = mix(s.albedo, board, sign);
}

void paintCurtainWall(const SurfaceObject& wall, float u, float v, float width, Surface& s) {
  const float panel = wall.width / std::max(1.f, std::round(wall.width / 1.5f));
  const int column = floorInt(u / panel), floor = floorInt((v - wall.groundHeight) / wall.floorHeight);
  const float inFloor = v - wall.groundHeight - wall.floorHeight * static_cast<float>(floor);
  const uint32_t hash = latticeHash(column, floor, wall.seed);
  const float spandrel = covered(inFloor, 0, 0.95f, width);
  const float tone = 0.75f + 0.5f * static_cast<float>(hash & 255u) / 256;
  Vec3f glass = wall.colour * tone;
  if ((hash >> 8) % 9 == 0) glass = mix(glass, Vec3f(0.4f, 0.4f, 0.36f), 0.5f);  // a blind
  glass = mix(glass, Vec3f(wall.colour * 0.5f), spandrel);
  const float frame =
      std::max(stripes(u + 0.04f, panel, 0.08f, width),
               std::max(covered(inFloor, -0.06f, 0.06f, width), 0.8f * covered(inFloor, 0.9f, 1.0f, width)));
  const float crown = covered(v, wall.height - 0.9f, wall.height + 1, width);
  const float metal = std::max(frame, crown);
  s.albedo = mix(glass, Vec3f(0.36f, 0.38f, 0.40f), metal);
  s.gloss = 1 - metal;
  s.reflectance = 0.16f;  // coated glass
  s.tracedMirror = true;
  // No two panes hang quite true.
  const Vec3f along(-s.normal.y(), s.normal.x(), 0);
  const float yaw = 0.012f * (static_cast<float>((hash >> 12) & 255u) / 128 - 1),
              tilt = 0.008f * (static_cast<float>((hash >> 20) & 255u) / 128 - 1);
  s.normal = (s.normal + along * yaw + Vec3f(0, 0, tilt)).normalized();
}

}  // namespace

void paintFacade(const SurfaceObject& wall, const Vec2f& at, float width, Surface& s) {
  const float u = at.x(), v = at.y();
  const auto style = static_cast<FacadeStyle>(wall.style);
  if (style == FacadeStyle::curtain) return paintCurtainWall(wall, u, v, width, s);

  s.albedo = wall.colour;
  if (style == FacadeStyle::brick || style == FacadeStyle::loft)
    s.albedo = brickwork(wall.colour, u, v, wall.seed, width);
  const float wear = weathering(u, v, wall, width);
  const bool ground = v < wall.groundHeight;
  const int floor = ground ? 0 : 1 + floorInt((v - wall.groundHeight) / wall.floorHeight);
  const float inFloor = ground ? v : v - wall.groundHeight - wall.floorHeight * static_cast<float>(floor - 1);
  const bool attic = floor >= wall.floors || v < 0;

  const float bay = bayWidth(wall.width, style);
  const int column = floorInt(u / bay);
  const float x = u - bay * (static_cast<float>(column) + 0.5f);
  const uint32_t hash = latticeHash(column, floor, wall.seed ^ 0x77u);
  Opening o;
  float sill = 0.9f;
  bool stone = false;
  switch (style) {
    case FacadeStyle::brick:
      o = {.width = 1.25f, .height = 1.65f, .columns = 2, .rows = 2};
      sill = 0.8f;
      stone = true;
      break;
    case FacadeStyle::loft:
      o = {.width = bay - 1.1f,
           .height = 2.4f,
           .frame = 0.07f,
           .columns = 4,
           .rows = 3,
           .frameColour = Vec3f(0.10f, 0.11f, 0.11f)};
      stone = true;
      break;
    case FacadeStyle::office:
      o = {.width = bay, .height = 1.75f, .frame = 0.06f, .columns = 2, .frameColour = Vec3f(0.28f, 0.28f, 0.28f)};
      sill = 1.0f;
      s.albedo *= 1 - 0.3f * stripes(u, bay, 0.05f, width);
      break;
    case FacadeStyle::panel:
      o = {.width = 1.9f, .height = 1.5f, .columns = 3};
      // Joints between the cast panels, and each panel its own batch of concrete.
      s.albedo *= 0.92f + 0.16f * latticeRandom(column, floor, wall.seed ^ 0x55u);
      s.albedo *= 1 - 0.45f * std::max(stripes(u + 0.03f, bay, 0.06f, width), covered(inFloor, -0.04f, 0.05f, width));
      break;
    case FacadeStyle::house:
      o = {.width = 1.35f, .height = 1.3f, .columns = 2};
      break;
    default:
      o = {.width = 1.15f, .height = 1.7f, .columns = 2};
      sill = 0.75f;
      break;
  }
  if (ground && wall.shops) {
    s.albedo = mix(s.albedo, Vec3f(0.42f, 0.40f, 0.37f), 0.7f) * wear;
    return paintShops(wall, u, v, width, s);
  }
  const bool blank = wall.width < 2.4f || attic || (style == FacadeStyle::house && hash % 4 == 0);
  if (!blank) {
    const float y = inFloor - sill;
    if (style == FacadeStyle::plaster || style == FacadeStyle::house) {
      // Pale trims around the windows, and shutters on some houses.
      const float trim = covered(x, -0.5f * o.width - 0.14f, 0.5f * o.width + 0.14f, width) *
                         covered(y, -0.14f, o.height + 0.14f, width);
      s.albedo = mix(s.albedo, Vec3f(0.74f, 0.72f, 0.67f), 0.8f * trim);
      if (wall.seed % 3 == 0) {
        const float shutter =
            covered(std::abs(x), 0.5f * o.width + 0.03f, 0.5f * o.width + 0.6f, width) * covered(y, 0, o.height, width);
        const Vec3f tint = wall.seed % 2 == 0 ? Vec3f(0.10f, 0.22f, 0.17f) : Vec3f(0.30f, 0.12f, 0.08f);
        s.albedo = mix(s.albedo, Vec3f(tint * (1 - 0.3f * stripes(y, 0.12f, 0.04f, width))), shutter);
      }
    }
    if (stone) {
      const float lintel = covered(x, -0.5f * o.width - 0.15f, 0.5f * o.width + 0.15f, width) *
                           std::max(covered(y, -0.15f, 0, width), covered(y, o.height, o.height + 0.25f, width));
      s.albedo = mix(s.albedo, Vec3f(0.56f, 0.52f, 0.45f), lintel);
    }
    Painted painted;
    const float share = paintOpening(o, x, y, hash, width, painted);
    s.albedo = mix(Vec3f(s.albedo * wear), painted.colour, share);
    s.gloss = share * painted.glass;
    // A sill throws a thin shadow on the wall below.
    s.albedo *= 1 - 0.3f * covered(x, -0.5f * o.width, 0.5f * o.width, width) * covered(y, -0.3f, -0.14f, width);
  } else {
    s.albedo *= wear;
  }
  if (style == FacadeStyle::plaster) s.albedo *= 1 - 0.18f * covered(inFloor, -0.05f, 0.12f, width);
}

}  // namespace tessera

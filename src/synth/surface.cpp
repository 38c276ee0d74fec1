#include "synth/surface.h"

namespace tessera {
namespace {

Vec3f waterNormal(float x, float y, uint32_t seed, float width) {
  const float e = 0.15f;
  const auto wave = [&](float px, float py) { return 0.035f * fractalNoise(px, py, seed, 1.9f, 3, width); };
  return Vec3f(-(wave(x + e, y) - wave(x - e, y)) / (2 * e), -(wave(x, y + e) - wave(x, y - e)) / (2 * e), 1)
      .normalized();
}

}  // namespace

void paintFlatRoof(const SurfaceObject& roof, const Vec2f& at, float width, Surface& s) {
  const float u = at.x(), v = at.y();
  if (roof.style == 1) {
    s.albedo = grassColour(u, v, roof.seed, width) * 0.95f;
    s.albedo =
        mix(s.albedo, Vec3f(0.34f, 0.20f, 0.15f), clamped(0.5f * fractalNoise(u, v, roof.seed ^ 4u, 4, 4, width)));
    return;
  }
  // Sheets of membrane, puddle marks, gravel grain.
  const int sheet = floorInt(u / 2.1f);
  s.albedo = roof.colour * (0.94f + 0.12f * latticeRandom(sheet, 0, roof.seed));
  s.albedo *= 1 - 0.22f * std::max(stripes(u, 2.1f, 0.09f, width),
                                   stripes(v + 3 * latticeRandom(sheet, 1, roof.seed), 7.5f, 0.09f, width));
  s.albedo *= 1 + 0.25f * fractalNoise(u, v, roof.seed ^ 1u, 6, 4, width) +
              0.12f * fractalNoise(u, v, roof.seed ^ 2u, 0.4f, 3, width);
  const float puddle = smoothStep(0.32f, 0.45f, fractalNoise(u, v, roof.seed ^ 3u, 5, 2, width));
  s.albedo *= 1 - 0.3f * puddle;
}

void paintTileRoof(const SurfaceObject& roof, const Vec2f& at, float width, Surface& s) {
  const float u = at.x(), v = at.y();
  const int row = floorInt(v / 0.34f), column = floorInt(u / 0.26f);
  const float keep = clamped(0.3f / (2 * width) - 0.5f);
  const float tone = latticeRandom(column, row, roof.seed) - 0.5f;
  s.albedo = roof.colour * (1 + 0.45f * tone * keep + 0.18f * fractalNoise(u, v, roof.seed ^ 1u, 3.5f, 5, width));
  s.albedo *= 1 - 0.4f * stripes(v, 0.34f, 0.05f, width);
  s.albedo *= 1 - 0.2f * stripes(u, 0.26f, 0.04f, width);
  const float moss = smoothStep(0.1f, 0.55f, fractalNoise(u, v, roof.seed ^ 2u, 2.6f, 4, width));
  s.albedo = mix(s.albedo, Vec3f(0.13f, 0.14f, 0.06f), 0.35f * moss);
  if (roof.shops) {
    const float cell = 4.2f;
    const float x = u - cell * (std::floor(u / cell) + 0.5f), y = v - 0.42f * roof.height;
    const float frame = covered(x, -0.5f, 0.5f, width) * covered(y, 0, 1.3f, width);
    const float glass = covered(x, -0.4f, 0.4f, width) * covered(y, 0.1f, 1.2f, width);
    if (latticeRandom(floorInt(u / cell), 9, roof.seed) < 0.6f && u > 1.5f && u < roof.width - 1.5f) {
      s.albedo = mix(mix(s.albedo, Vec3f(0.2f, 0.2f, 0.2f), frame), Vec3f(0.05f, 0.06f, 0.07f), glass);
      s.gloss = glass;
    }
  }
}

Surface surfaceAt(const CityLayout& city, const SurfaceHit& hit, float width) {
  Surface s;
  s.normal = hit.normal;
  const SurfaceObject& object = *hit.object;
  const Vec3f& p = hit.position;
  const float u = hit.textureAt.x(), v = hit.textureAt.y();
  switch (hit.material) {
    case Material::terrain:
      s.albedo = terrainColour(city, p.x(), p.y(), width);
      s.normal = city.terrainNormal(p.x(), p.y());
      break;
    case Material::blockTop:
      s.albedo = blockTopColour(city.blocks[object.block], p.x(), p.y(), width);
      break;
    case Material::kerb:
      s.albedo = Vec3f(0.45f, 0.44f, 0.42f);
      break;
    case Material::facade:
      paintFacade(object, hit.textureAt, width, s);
      break;
    case Material::flatRoof:
      paintFlatRoof(object, hit.textureAt, width, s);
      break;
    case Material::tileRoof:
      paintTileRoof(object, hit.textureAt, width, s);
      break;
    case Material::parapet:
    case Material::plain:
      s.albedo = object.colour * (1 + 0.12f * fractalNoise(u, v, object.seed, 2.5f, 4, width));
      break;
    case Material::metal:
    case Material::lamp:
      s.albedo = object.colour * (1 - 0.15f * stripes(u, 0.9f, 0.05f, width));
      break;
    case Material::vents: {
      const float grille = covered(fraction(u / 1.3f), 0.15f, 0.85f, width / 1.3f) * covered(v, 0.2f, 1.4f, width);
      s.albedo = object.colour * (1 - 0.5f * grille * stripes(v, 0.16f, 0.08f, width));
      break;
    }
    case Material::solarPanel:
      s.albedo = mix(object.colour, Vec3f(0.35f, 0.36f, 0.38f),
                     std::max(stripes(u, 1, 0.05f, width), stripes(v, 1.45f, 0.06f, width)));
      s.gloss = 0.9f;
      break;
    case Material::skylight:
      s.albedo = mix(object.colour, Vec3f(0.6f, 0.6f, 0.6f), stripes(u, 1.5f, 0.12f, width));
      s.gloss = 0.8f;
      break;
    case Material::awning:
      s.albedo =
          mix(object.colour, Vec3f(0.72f, 0.70f, 0.64f), object.seed % 2 == 0 ? stripes(u, 0.6f, 0.3f, width) : 0.f);
      s.translucency = 0.15f;
      break;
    case Material::water:
      s.albedo = Vec3f(0.022f, 0.045f, 0.036f) * (1 + 0.3f * fractalNoise(p.x(), p.y(), object.seed, 9, 3, width));
      s.normal = waterNormal(p.x(), p.y(), object.seed, width);
      s.gloss = 1;
      s.reflectance = 0.045f;
      s.tracedMirror = true;
      break;
    case Material::leaf: {
      // The crown's roundness, broken up by each card's own tilt.
      const Vec3f outward = (p - object.centre).cwiseProduct(Vec3f(1, 1, 0.8f)).normalized();
      s.normal = (outward * 0.75f + hit.normal * 0.45f + Vec3f(0, 0, 0.2f)).normalized();
      const float tone = latticeRandom(static_cast<int>(hit.face), 1, object.seed);
      // Little light arrives deep inside the crown.
      const float depth = ((p - object.centre).norm() / std::max(object.width, 0.45f * object.height));
      s.albedo = object.colour * ((0.75f + 0.5f * tone) * (0.45f + 0.65f * smoothStep(0.2f, 0.95f, depth)));
      s.translucency = 0.3f;
      break;
    }
    case Material::bark:
    case Material::wood:
      s.albedo = object.colour * (1 + 0.3f * fractalNoise(u * 4, v, object.seed, 0.6f, 3, width));
      break;
    case Material::carPaint:
      s.albedo = object.colour;
      s.gloss = 0.8f;
      break;
    case Material::carGlass:
      s.albedo = object.colour;
      s.gloss = 1;
      break;
    case Material::wire:
    case Material::rubber:
      s.albedo = object.colour;
      break;
  }
  s.albedo = s.albedo.cwiseMax(0.005f).cwiseMin(0.9f);
  return s;
}

}  // namespace tessera

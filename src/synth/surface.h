// Procedural materials: the appearance of a point of the city before lighting.
#pragma once

#include "synth/layout.h"
#include "synth/tracer.h"

namespace tessera {

struct Surface {
  Vec3f albedo{0.5f, 0.5f, 0.5f};  // diffuse reflectance, linear
  Vec3f normal{0, 0, 1};
  float gloss = 0;            // fraction of the footprint that mirrors like glass or water (Fresnel)
  float reflectance = 0.04f;  // of that fraction, at normal incidence
  bool tracedMirror = false;  // whether it mirrors the city; otherwise it mirrors only the sky
  float translucency = 0;     // fraction of the sunlight that shines through from behind
};

// `width`: footprint of the sample on the surface, metres.
Surface surfaceAt(const CityLayout& city, const SurfaceHit& hit, float width);

// Parts of surfaceAt, by theme.
Vec3f terrainColour(const CityLayout& city, float x, float y, float width);
Vec3f blockTopColour(const Block& block, float x, float y, float width);
Vec3f grassColour(float x, float y, uint32_t seed, float width);
void paintFacade(const SurfaceObject& wall, const Vec2f& at, float width, Surface& surface);
void paintFlatRoof(const SurfaceObject& roof, const Vec2f& at, float width, Surface& surface);
void paintTileRoof(const SurfaceObject& roof, const Vec2f& at, float width, Surface& surface);

}  // namespace tessera

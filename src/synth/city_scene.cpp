#include "synth/city_scene.h"

#include <numbers>

#include "synth/surface.h"

namespace tessera {
namespace {

constexpr float kNudge = 4e-3f;  // metres off a surface before the next ray starts

struct Shading {
  const CityScene& city;
  const TrafficScene* traffic;
  float spread;
  Vec3f towardsSun;  // a point on its disc
  bool touchedTraffic = false;

  bool sunReaches(const Vec3f& x) {
    const Ray ray{x, towardsSun, 0};
    if (city.tracer->occluded(ray)) return false;
    if (traffic == nullptr || !traffic->tracer->occluded(ray)) return true;
    touchedTraffic = true;
    return false;
  }

  Vec3f along(const Ray& ray, float travelled, bool mirrored) {
    bool moving = false;
    const std::optional<SurfaceHit> hit = firstHit(city, traffic, ray, &moving);
    touchedTraffic |= moving;
    if (!hit) return city.sky.radiance(ray.direction);
    const float distance = travelled + hit->distance;
    const float facing = std::max(0.15f, -hit->normal.dot(ray.direction));
    const Surface s = surfaceAt(city.layout, *hit, distance * spread / std::sqrt(facing));
    const Vec3f colour = shade(ray, *hit, s, distance, mirrored);
    // Thin haze, the colour of the horizon.
    const float haze = 1 - std::exp(-distance * distance / (1500.f * 1500.f) - distance / 9000.f);
    return mix(colour, Vec3f(0.66f, 0.73f, 0.83f), haze);
  }

  Vec3f shade(const Ray& ray, const SurfaceHit& hit, const Surface& s, float distance, bool mirrored) {
    const Vec3f start = hit.position + hit.normal * (kNudge + 2e-5f * distance);
    const float sunward = s.normal.dot(towardsSun);
    const float lit =
        std::max(0.f, sunward) + s.translucency * std::max(0.f, -sunward) + (s.translucency > 0 ? 0.12f : 0.f);
    Vec3f arriving = city.light.at(hit.position, s.normal);
    const float side = hit.normal.dot(towardsSun);
    const Vec3f lightStart = s.translucency > 0 && side < 0 ? Vec3f(hit.position - hit.normal * kNudge) : start;
    if (lit > 0 && (side > 0 || s.translucency > 0) && sunReaches(lightStart)) arriving += city.sky.sunLight * lit;
    Vec3f colour = s.albedo.cwiseProduct(arriving);
    if (s.gloss <= 0) return colour;

    // Schlick's Fresnel term.
    const float cosine = clamped(-s.normal.dot(ray.direction));
    const float fresnel = s.reflectance + (1 - s.reflectance) * std::pow(1 - cosine, 5.f);
    Vec3f out = ray.direction - s.normal * (2 * s.normal.dot(ray.direction));
    if (out.dot(hit.normal) < 0.01f) out = (out + hit.normal * (0.02f - out.dot(hit.normal))).normalized();
    Vec3f image;
    if (s.tracedMirror && !mirrored) {
      image = along({start, out}, distance, true);
    } else {
      // An average colour for the streets and houses opposite.
      image = mix(Vec3f(0.22f, 0.21f, 0.19f), city.sky.radiance(out.z() > 0 ? out : Vec3f(out.x(), out.y(), 0)),
                  smoothStep(-0.05f, 0.3f, out.z()));
    }
    return mix(colour, image, s.gloss * fresnel);
  }
};

}  // namespace

CityScene::CityScene(int blocksX, int blocksY, uint64_t seed, ThreadPool& pool)
    : layout(planCity(blocksX, blocksY, seed)), sky(Sky::ofDay(seed)), mesh(buildCity(layout)) {
  tracer.emplace(device, mesh);
  light = LightVolume(layout, *tracer, sky, pool);
}

TrafficScene::TrafficScene(const CityScene& city, double seconds) : mesh(buildTraffic(city.layout, seconds)) {
  tracer.emplace(city.device, mesh);
}

std::optional<SurfaceHit> firstHit(const CityScene& city, const TrafficScene* traffic, const Ray& ray, bool* moving) {
  std::optional<SurfaceHit> hit = city.tracer->intersect(ray);
  if (moving != nullptr) *moving = false;
  if (traffic == nullptr) return hit;
  Ray shorter = ray;
  if (hit) shorter.far = hit->distance;
  if (std::optional<SurfaceHit> car = traffic->tracer->intersect(shorter)) {
    if (moving != nullptr) *moving = true;
    return car;
  }
  return hit;
}

RayLight lightAlong(const CityScene& city, const TrafficScene* traffic, const Ray& ray, float spread,
                    const Vec2f& jitter) {
  const Vec3f sun = city.sky.towardsSun;
  const Vec3f x = sun.cross(Vec3f(0, 0, 1)).normalized(), y = sun.cross(x);
  const float r = city.sky.sunRadius * std::sqrt(jitter.x()), angle = 2 * std::numbers::pi_v<float> * jitter.y();
  Shading shading{city, traffic, spread, (sun + x * (r * std::cos(angle)) + y * (r * std::sin(angle))).normalized()};
  const Vec3f radiance = shading.along(ray, 0, false);
  return {radiance, shading.touchedTraffic};
}

}  // namespace tessera

#include <array>
#include <numbers>

#include "synth/city_geometry.h"

namespace tessera {
namespace {

constexpr float kHalfTurn = std::numbers::pi_v<float>;  // radians

// A closed body from two rectangles, one above the other: bonnet line to roof line.
void addFrustum(const std::array<Vec3f, 4>& low, const std::array<Vec3f, 4>& high, Material sides, uint32_t sideObject,
                Material top, uint32_t topObject, SurfaceMesh& mesh) {
  for (int i = 0; i < 4; ++i) mesh.addQuad(low[i], low[(i + 1) % 4], high[(i + 1) % 4], high[i], sides, sideObject);
  mesh.addQuad(high[0], high[1], high[2], high[3], top, topObject);
}

}  // namespace

void addCar(const Vec3f& foot, float yaw, uint32_t seed, SurfaceMesh& mesh) {
  RandomSequence random(seed);
  static constexpr float kPaint[12][3] = {{0.75f, 0.75f, 0.76f}, {0.04f, 0.04f, 0.05f}, {0.35f, 0.36f, 0.38f},
                                          {0.45f, 0.03f, 0.03f}, {0.04f, 0.10f, 0.32f}, {0.80f, 0.80f, 0.78f},
                                          {0.10f, 0.22f, 0.14f}, {0.62f, 0.40f, 0.07f}, {0.70f, 0.71f, 0.72f},
                                          {0.10f, 0.10f, 0.11f}, {0.22f, 0.23f, 0.25f}, {0.78f, 0.77f, 0.75f}};
  const float* tint = kPaint[random.below(12)];
  const uint32_t paint = mesh.addObject({.seed = seed, .colour = {tint[0], tint[1], tint[2]}});
  const uint32_t glass = mesh.addObject({.seed = seed, .colour = {0.02f, 0.025f, 0.03f}});
  const uint32_t tyre = mesh.addObject({.seed = seed, .colour = {0.02f, 0.02f, 0.02f}});
  const bool van = random.chance(0.18f);
  const float halfLength = van ? 2.6f : random.between(2, 2.3f), halfWidth = van ? 0.98f : 0.88f;
  const float belt = van ? 1.15f : 0.88f, roof = van ? 2.2f : 1.45f;
  const float c = std::cos(yaw), s = std::sin(yaw);
  const auto place = [&](float x, float y, float z) {
    return Vec3f(foot.x() + c * x - s * y, foot.y() + s * x + c * y, foot.z() + z);
  };
  const auto ring = [&](float x0, float x1, float y, float z) {
    return std::array<Vec3f, 4>{place(x0, -y, z), place(x1, -y, z), place(x1, y, z), place(x0, y, z)};
  };
  addFrustum(ring(-halfLength, halfLength, halfWidth, 0.25f),
             ring(-halfLength + 0.05f, halfLength - 0.08f, halfWidth - 0.03f, belt), Material::carPaint, paint,
             Material::carPaint, paint, mesh);
  const float back = van ? -halfLength + 0.1f : -halfLength + 0.35f,
              front = van ? halfLength - 0.7f : halfLength - 1.05f;
  addFrustum(ring(back, front, halfWidth - 0.06f, belt),
             ring(back + 0.35f, front - (van ? 0.4f : 0.75f), halfWidth - 0.2f, roof), Material::carGlass, glass,
             Material::carPaint, paint, mesh);
  for (float x : {-0.62f * halfLength, 0.62f * halfLength})
    for (float y : {-1.f, 1.f})
      mesh.addTube(place(x, y * (halfWidth - 0.2f), 0.32f), place(x, y * (halfWidth + 0.01f), 0.32f), 0.32f, 0.32f, 8,
                   Material::rubber, tyre);
}

SurfaceMesh buildTraffic(const CityLayout& city, double seconds) {
  SurfaceMesh mesh;
  RandomSequence random(city.seed ^ 0xca45u);
  const auto drive = [&](const Street& street, bool alongX) {
    const float from = (alongX ? city.area.x0 : city.area.y0) - 90, to = (alongX ? city.area.x1 : city.area.y1) + 90;
    const float length = to - from;
    for (int direction = -1; direction <= 1; direction += 2) {
      const double speed = random.between(7, 12);
      const int cars = std::max(1, static_cast<int>(length / random.between(28, 48)));
      for (int i = 0; i < cars; ++i) {
        const double start = length * (i + 0.7 * random.uniform()) / cars;
        const uint32_t seed = random.seed();
        double along = std::fmod(start + speed * seconds, static_cast<double>(length));
        if (direction < 0) along = length - along;
        // Traffic keeps right.
        const float lane = street.centre + (alongX ? -1.f : 1.f) * static_cast<float>(direction) * 0.15f * street.width;
        const float x = alongX ? from + static_cast<float>(along) : lane;
        const float y = alongX ? lane : from + static_cast<float>(along);
        const float yaw = (alongX ? 0.f : 0.5f * kHalfTurn) + (direction < 0 ? kHalfTurn : 0.f);
        addCar({x, y, city.terrain(x, y)}, yaw, seed, mesh);
      }
    }
  };
  for (const Street& street : city.alongY) drive(street, false);
  for (const Street& street : city.alongX) drive(street, true);
  return mesh;
}

}  // namespace tessera

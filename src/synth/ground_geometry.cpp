#include <numbers>

#include "synth/city_geometry.h"

namespace tessera {
namespace {

// Grid lines: even steps inside [low, high], growing ones out to `far` beyond.
std::vector<float> gridLines(float low, float high, float step, float far) {
  std::vector<float> lines;
  const int count = std::max(1, static_cast<int>(std::ceil((high - low) / step)));
  for (int i = 0; i <= count; ++i) lines.push_back(mix(low, high, static_cast<float>(i) / static_cast<float>(count)));
  std::vector<float> before;
  float width = step, out = 0;
  while (out < far) {
    width = std::min(width * 1.12f, 60.f);
    out += width;
    before.push_back(low - out);
    lines.push_back(high + out);
  }
  std::vector<float> all(before.rbegin(), before.rend());
  all.insert(all.end(), lines.begin(), lines.end());
  return all;
}

template <class Height>
void addGrid(const std::vector<float>& xs, const std::vector<float>& ys, const Height& height, Material material,
             uint32_t object, SurfaceMesh& mesh) {
  const uint32_t first = static_cast<uint32_t>(mesh.positions.size());
  for (float y : ys)
    for (float x : xs) mesh.addVertex({x, y, height(x, y)}, {x, y});
  const uint32_t columns = static_cast<uint32_t>(xs.size());
  for (uint32_t j = 0; j + 1 < ys.size(); ++j) {
    for (uint32_t i = 0; i + 1 < columns; ++i) {
      const uint32_t a = first + j * columns + i, b = a + 1, d = a + columns, c = d + 1;
      mesh.faces.push_back({a, b, c, object, material});
      mesh.faces.push_back({a, c, d, object, material});
    }
  }
}

void addBlockTop(const CityLayout& city, const Block& block, uint32_t object, SurfaceMesh& mesh) {
  const Rect& a = block.area;
  const float step = block.ponds.empty() ? 3.f : 1.25f;
  const std::vector<float> xs = gridLines(a.x0, a.x1, step, 0), ys = gridLines(a.y0, a.y1, step, 0);
  addGrid(
      xs, ys,
      [&](float x, float y) {
        // Sampled just inside, so that the outermost line belongs to this block.
        return city.ground(clamped(x, a.x0 + 1e-3f, a.x1 - 1e-3f), clamped(y, a.y0 + 1e-3f, a.y1 - 1e-3f));
      },
      Material::blockTop, object, mesh);
  const auto kerb = [&](float x0, float y0, float x1, float y1) {
    const float z0 = city.terrain(x0, y0), z1 = city.terrain(x1, y1);
    mesh.addQuad({x0, y0, z0 - 0.4f}, {x1, y1, z1 - 0.4f}, {x1, y1, z1 + kKerbHeight}, {x0, y0, z0 + kKerbHeight},
                 Material::kerb, object);
  };
  for (size_t i = 0; i + 1 < xs.size(); ++i) {
    kerb(xs[i], a.y0, xs[i + 1], a.y0);
    kerb(xs[i + 1], a.y1, xs[i], a.y1);
  }
  for (size_t j = 0; j + 1 < ys.size(); ++j) {
    kerb(a.x1, ys[j], a.x1, ys[j + 1]);
    kerb(a.x0, ys[j + 1], a.x0, ys[j]);
  }
}

// Larger than the shore: where water ends is where the ground rises through it.
void addWater(const Pond& pond, uint32_t seed, SurfaceMesh& mesh) {
  const uint32_t object = mesh.addObject({.seed = seed});
  constexpr int kSides = 48;
  const auto rim = [&](int i) {
    const float angle = 2 * std::numbers::pi_v<float> * static_cast<float>(i % kSides) / kSides;
    return Vec3f(pond.centre.x() + 1.3f * pond.radiusX * std::cos(angle),
                 pond.centre.y() + 1.3f * pond.radiusY * std::sin(angle), pond.level);
  };
  const Vec3f middle(pond.centre.x(), pond.centre.y(), pond.level);
  for (int i = 0; i < kSides; ++i) mesh.addTriangle(middle, rim(i), rim(i + 1), Material::water, object);
}

}  // namespace

void addGround(const CityLayout& city, SurfaceMesh& mesh) {
  const uint32_t land = mesh.addObject({.seed = city.seed});
  const Rect near = city.area.inset(-60);
  addGrid(
      gridLines(near.x0, near.x1, 2.5f, 2400), gridLines(near.y0, near.y1, 2.5f, 2400),
      [&](float x, float y) {
        // Under a block the terrain keeps clear of lawns and ponds.
        const Block* block = city.blockAt(x, y);
        return city.terrain(x, y) - (block != nullptr && block->area.inside(x, y) > 3 ? 2.5f : 0);
      },
      Material::terrain, land, mesh);
  for (size_t i = 0; i < city.blocks.size(); ++i) {
    const Block& block = city.blocks[i];
    const uint32_t object = mesh.addObject({.seed = block.seed, .block = static_cast<uint32_t>(i)});
    addBlockTop(city, block, object, mesh);
    for (const Pond& pond : block.ponds) addWater(pond, block.seed, mesh);
  }
}

SurfaceMesh buildCity(const CityLayout& city) {
  SurfaceMesh mesh;
  addGround(city, mesh);
  for (const Building& building : city.buildings) addBuilding(building, mesh);
  for (const Tree& tree : city.trees) addTree(tree, city.ground(tree.foot.x(), tree.foot.y()), mesh);
  addStreetFurniture(city, mesh);
  for (const ParkedCar& car : city.parkedCars)
    addCar({car.centre.x(), car.centre.y(), city.terrain(car.centre.x(), car.centre.y())}, car.yaw, car.seed, mesh);
  return mesh;
}

}  // namespace tessera

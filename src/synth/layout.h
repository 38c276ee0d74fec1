// The plan of a city: streets, blocks, buildings, trees, poles. Plain data in metres, without triangles; a function of
// size and seed alone. World axes: x east, y north, z up, origin at the middle of the city.
#pragma once

#include <cstdint>
#include <vector>

#include "synth/noise.h"

namespace tessera {

struct Rect {
  float x0 = 0, y0 = 0, x1 = 0, y1 = 0;

  float width() const { return x1 - x0; }
  float depth() const { return y1 - y0; }
  Vec2f centre() const { return {0.5f * (x0 + x1), 0.5f * (y0 + y1)}; }
  Rect inset(float d) const { return {x0 + d, y0 + d, x1 - d, y1 - d}; }
  bool contains(float x, float y) const { return x >= x0 && x < x1 && y >= y0 && y < y1; }
  // Distance to the edge, positive inside.
  float inside(float x, float y) const { return std::min(std::min(x - x0, x1 - x), std::min(y - y0, y1 - y)); }
};

enum class BlockKind { perimeter, towers, park, houses };
enum class FacadeStyle { brick, plaster, office, panel, loft, curtain, house };
enum class RoofStyle { flat, gable, hip };

// A building stands on a rectangle turned by `yaw`; `corners` above 4 makes it a prism inscribed in that rectangle.
struct Building {
  Vec2f centre{0, 0};
  float yaw = 0, halfX = 5, halfY = 5;
  int corners = 4;
  float base = 0;  // z of the ground floor, metres
  int floors = 3;
  float groundHeight = 3.6f, floorHeight = 3.1f;
  FacadeStyle style = FacadeStyle::brick;
  RoofStyle roof = RoofStyle::flat;
  Vec3f colour{0.5f, 0.5f, 0.5f};
  bool shops = false;
  uint32_t seed = 0;

  float height() const { return groundHeight + floorHeight * static_cast<float>(floors - 1) + 0.4f; }
  Vec2f place(float x, float y) const;  // from the building's own axes to the world's
  std::vector<Vec2f> outline() const;   // counter-clockwise
};

struct Pond {
  Vec2f centre{0, 0};
  float radiusX = 0, radiusY = 0, level = 0;
  // Returns a value below 1 inside the shore.
  float reach(float x, float y) const;
};

struct Block {
  Rect area;  // between the kerbs
  BlockKind kind = BlockKind::perimeter;
  uint32_t seed = 0;
  std::vector<Pond> ponds;
};

struct Tree {
  Vec2f foot{0, 0};
  float height = 8, radius = 3;
  bool conifer = false;
  int leafCards = 300;
  uint32_t seed = 0;
};

struct Pole {
  Vec2f foot{0, 0};
  float height = 10;
  bool wires = true;  // wired to the next pole in the list
};

struct ParkedCar {
  Vec2f centre{0, 0};
  float yaw = 0;
  uint32_t seed = 0;
};

struct Street {
  float centre = 0, width = 14;
};

struct CityLayout {
  uint32_t seed = 0;
  Rect area;                           // the city including its outermost streets
  std::vector<Street> alongY, alongX;  // streets at a constant x, and at a constant y
  std::vector<Block> blocks;           // row by row from the south-west
  std::vector<Building> buildings;
  std::vector<Tree> trees;
  std::vector<Pole> poles, lamps;
  std::vector<ParkedCar> parkedCars;

  // Returns the ground height without kerbs: gentle in the city, hills outside.
  float terrain(float x, float y) const;
  Vec3f terrainNormal(float x, float y) const;
  // Returns the height of the walkable surface: the terrain, 15 cm higher on blocks, lower in ponds.
  float ground(float x, float y) const;
  const Block* blockAt(float x, float y) const;
  // Returns an upper bound of the highest roof within `radius` of a place, or the ground.
  float highestNear(float x, float y, float radius) const;
};

// Returns the width of the bays into which a facade is divided; walls, textures and balconies use the same.
float bayWidth(float wallLength, FacadeStyle style);

inline constexpr float kPavementWidth = 3.2f;
inline constexpr float kKerbHeight = 0.15f;

CityLayout planCity(int blocksX, int blocksY, uint64_t seed);

// Plans the buildings, trees and ponds of one block; called by planCity.
void planBlock(CityLayout& city, Block& block);
// Plans the country around the city: houses and trees of little detail.
void planEnvirons(CityLayout& city);

}  // namespace tessera

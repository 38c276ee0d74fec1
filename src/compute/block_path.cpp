#include "compute/block_path.h"

#include <algorithm>

namespace tessera {

BlockDomain makeBlockDomain(const BlockSpace::Placement& placement) {
  BlockDomain domain;
  for (int a = 0; a < 3; ++a) {
    domain.centre[a] = placement.centre[a];
    domain.scale[a] = placement.scale[a];
  }
  domain.contracted = placement.contracted;
  return domain;
}

namespace {

struct Ray {
  const Triple<double>&origin, &direction;
};

// Adds the pieces of the ray between two distances, between which it stays in one block.
void addPieces(const BlockSpace& space, const Ray& ray, double near, double far, std::vector<BlockPiece>& pieces) {
  const double middle = 0.5 * (near + far);
  Triple<double> x;
  for (int a = 0; a < 3; ++a) x[a] = ray.origin[a] + middle * ray.direction[a];
  const uint32_t block = space.blockAt(x[0], x[1], x[2]);
  const BlockDomain domain = makeBlockDomain(space.placement(block));
  if (!domain.contracted) {  // along x and y, walls already bound the piece
    const double o = ray.origin[2] - domain.centre[2], d = ray.direction[2];
    if (std::abs(o + middle * d) > 1 && d == 0) return;
    if (d != 0) {
      near = std::max(near, std::min((-1 - o) / d, (1 - o) / d));
      far = std::min(far, std::max((-1 - o) / d, (1 - o) / d));
    }
  }
  const DomainPath path = domainPath(domain, ray.origin, ray.direction, near, far);
  for (int i = 0; i < path.count; ++i) pieces.push_back({block, path.segments[i]});
}

}  // namespace

void blockPath(const BlockSpace& space, const Triple<double>& origin, const Triple<double>& direction, double near,
               std::vector<BlockPiece>& pieces) {
  pieces.clear();
  if (direction == Triple<double>{}) return;
  near = std::max<double>(near, space.near);
  const BlockSpace::Range box = space.rangeInBox(origin, direction, near);
  const Ray ray{origin, direction};
  const bool own = space.backgroundBlock == BackgroundBlockMode::own;
  if (!box.empty()) near = box.near;
  // The distance up to which cells own the ray.
  double walled = own || space.backgroundBlock == BackgroundBlockMode::none ? box.far : BlockSpace::kFarthest;
  if (box.empty() && space.backgroundBlock != BackgroundBlockMode::border) walled = near;
  std::vector<double> walls;
  for (int axis : {0, 1}) {
    const int cells = static_cast<int>(axis == 0 ? space.columns : space.rows);
    for (int wall = 2 - cells; wall < cells && direction[axis] != 0; wall += 2) {
      const double t = (wall - origin[axis]) / direction[axis];
      if (t > near && t < walled) walls.push_back(t);
    }
  }
  std::sort(walls.begin(), walls.end());
  walls.push_back(walled);
  double from = near;
  for (const double to : walls) {
    if (from < to) addPieces(space, ray, from, to, pieces);
    from = std::max(from, to);
  }
  if (own) addPieces(space, ray, from, BlockSpace::kFarthest, pieces);
}

}  // namespace tessera

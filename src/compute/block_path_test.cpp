#include "compute/block_path.h"

#include <gtest/gtest.h>

#include <cmath>

#include "base/random.h"

namespace tessera {
namespace {

Triple<double> along(const Triple<double>& origin, const Triple<double>& direction, double t) {
  return {origin[0] + t * direction[0], origin[1] + t * direction[1], origin[2] + t * direction[2]};
}

// A ray with an origin inside, above or beside the box.
struct RandomRay {
  Triple<double> origin, direction;

  RandomRay(const RandomStream& random, uint64_t number) {
    double square = 0;
    for (uint64_t a = 0; a < 3; ++a) {
      origin[a] = (number % 3 == 0 ? 9 : 3) * (2 * random.uniformDouble(6 * number + a) - 1);
      direction[a] = 2 * random.uniformDouble(6 * number + 3 + a) - 1;
      square += direction[a] * direction[a];
    }
    for (double& d : direction) d /= std::sqrt(square);
  }
};

constexpr BackgroundBlockMode kBackgroundBlocks[] = {BackgroundBlockMode::none, BackgroundBlockMode::border,
                                                     BackgroundBlockMode::own};

BlockSpace spaceWith(BackgroundBlockMode backgroundBlock) {
  return {.columns = 4, .rows = 3, .bottom = -0.4f, .top = 0.7f, .near = 0.1f, .backgroundBlock = backgroundBlock};
}

TEST(BlockPath, MapsEachPointToItsBlockAndItsPositionInTheDomain) {
  const RandomStream random(1, 2);
  std::vector<BlockPiece> pieces;
  for (const BackgroundBlockMode backgroundBlock : kBackgroundBlocks) {
    const BlockSpace space = spaceWith(backgroundBlock);
    for (uint64_t number = 0; number < 2000; ++number) {
      const RandomRay ray(random, number);
      blockPath(space, ray.origin, ray.direction, 0, pieces);
      for (const BlockPiece& piece : pieces) {
        const BlockDomain domain = makeBlockDomain(space.placement(piece.block));
        for (const double share : {0.01, 0.3, 0.5, 0.7, 0.99}) {
          const double tau = share * piece.segment.length, t = piece.segment.distanceAt(tau);
          const Triple<double> x = along(ray.origin, ray.direction, t);
          ASSERT_EQ(space.blockAt(x[0], x[1], x[2]), piece.block) << number;
          Triple<double> q;
          for (int a = 0; a < 3; ++a) q[a] = (x[a] - domain.centre[a]) / domain.scale[a];
          const Triple<double> y = domain.contracted ? contract(q) : q;
          for (int a = 0; a < 3; ++a) {
            ASSERT_NEAR(piece.segment.start[a] + tau * piece.segment.direction[a], y[a], 1e-6 * (1 + 1e-3 * t));
            ASSERT_LE(std::abs(y[a]), domain.half() + 1e-9);
          }
        }
      }
    }
  }
}

TEST(BlockPath, CoversTheWholeRayUpToItsFarthestDistance) {
  const RandomStream random(3, 4);
  std::vector<BlockPiece> pieces;
  for (const BackgroundBlockMode backgroundBlock : {BackgroundBlockMode::none, BackgroundBlockMode::own}) {
    const BlockSpace space = spaceWith(backgroundBlock);
    for (uint64_t number = 0; number < 2000; ++number) {
      const RandomRay ray(random, number);
      blockPath(space, ray.origin, ray.direction, 0.5, pieces);
      const BlockSpace::Range box = space.rangeInBox(ray.origin, ray.direction, 0.5);
      const bool own = backgroundBlock == BackgroundBlockMode::own;
      if (box.empty() && !own) {
        EXPECT_TRUE(pieces.empty());
        continue;
      }
      ASSERT_FALSE(pieces.empty());
      double end = box.empty() ? 0.5 : box.near;
      for (const BlockPiece& piece : pieces) {
        EXPECT_NEAR(piece.segment.entry, end, 1e-9 * (1 + end));
        end = piece.segment.distanceAt(piece.segment.length);
      }
      const double last = own ? BlockSpace::kFarthest : box.far;
      EXPECT_NEAR(1 / end, 1 / last, 1e-9) << number;  // the lengths of the pieces add up to that of the ray
    }
  }
}

TEST(BlockPath, IsEmptyForDirectionZero) {
  std::vector<BlockPiece> pieces(3);
  blockPath(spaceWith(BackgroundBlockMode::own), {0, 0, 0}, {0, 0, 0}, 0, pieces);
  EXPECT_TRUE(pieces.empty());
}

}  // namespace
}  // namespace tessera

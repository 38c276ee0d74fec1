// Properties of samples through blocks that must hold on every device, independently of the reference.
#include "compute/blocks.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "compute/device_test.h"
#include "compute/rows.h"
#include "scene/block_grid.h"
#include "scene/contraction.h"

namespace tessera::device_test {
namespace {

BlockSpace makeSpace(uint32_t columns, uint32_t rows, BackgroundBlockMode backgroundBlock) {
  return {.columns = columns, .rows = rows, .bottom = -0.4f, .top = 0.6f, .backgroundBlock = backgroundBlock};
}

const BlockSpace kSpaces[] = {makeSpace(1, 1, BackgroundBlockMode::none),   makeSpace(3, 2, BackgroundBlockMode::none),
                              makeSpace(4, 3, BackgroundBlockMode::border), makeSpace(1, 1, BackgroundBlockMode::own),
                              makeSpace(3, 2, BackgroundBlockMode::own),    makeSpace(2, 5, BackgroundBlockMode::own)};

std::string spaceName(const BlockSpace& space) {
  constexpr const char* kNames[] = {"none", "border", "own"};
  return fmt::format("{} × {}, {}", space.columns, space.rows, kNames[static_cast<int>(space.backgroundBlock)]);
}

BlockGrid toBlockGrid(const BlockSpace& space) {
  BlockGrid grid;
  grid.edge = 2;
  grid.columns = static_cast<int>(space.columns);
  grid.rows = static_cast<int>(space.rows);
  return grid;
}

bool isInBox(const BlockSpace& space, double x, double y, double z) {
  return std::abs(x) <= space.columns && std::abs(y) <= space.rows && z >= space.bottom && z <= space.top;
}

TEST(BlockSpace, GivesEveryPointToTheOneBlockThatOwnsIt) {
  Random random(1);
  for (const BlockSpace& space : kSpaces) {
    const BlockGrid grid = toBlockGrid(space);
    std::set<uint32_t> met;
    for (int n = 0; n < 2000; ++n) {
      const float reach = n % 2 == 0 ? 1 : 3;
      const double x = reach * random.uniform(-4, 4), y = reach * random.uniform(-4, 4), z = random.uniform(-1, 1);
      const uint32_t block = space.blockAt(x, y, z);
      ASSERT_LT(block, space.blocks());
      met.insert(block);
      if (space.backgroundBlock == BackgroundBlockMode::own && !isInBox(space, x, y, z)) {
        EXPECT_EQ(block, space.cells());
      } else {
        EXPECT_EQ(static_cast<int>(block), grid.cellAt(Vec2d(x, y))) << spaceName(space) << ": " << x << ' ' << y;
      }
      // The domain of the block contains the point.
      const BlockSpace::Placement place = space.placement(block);
      Triple<double> q = {(x - place.centre[0]) / place.scale[0], (y - place.centre[1]) / place.scale[1], z};
      if (place.contracted) q = contract(q);
      if (!place.contracted && !isInBox(space, x, y, z)) continue;
      for (double coordinate : q) EXPECT_LE(std::abs(coordinate), place.halfDomain()) << spaceName(space);
    }
    EXPECT_EQ(met.size(), space.blocks()) << spaceName(space);
  }
}

TEST(BlockSpace, ContractsTheBorderOrTheBackgroundBlockAlone) {
  const BlockSpace border = makeSpace(4, 3, BackgroundBlockMode::border),
                   own = makeSpace(4, 3, BackgroundBlockMode::own);
  for (uint32_t block = 0; block < 12; ++block) {
    EXPECT_EQ(border.placement(block).contracted, block != 5 && block != 6) << block;
    EXPECT_FALSE(own.placement(block).contracted);
  }
  EXPECT_EQ(border.blocks(), 12u);
  EXPECT_EQ(own.blocks(), 13u);
  EXPECT_TRUE(own.placement(12).contracted);
  EXPECT_EQ(own.placement(12).scale[0], 4);
  EXPECT_EQ(own.placement(4).centre[0], -3);
  EXPECT_EQ(own.placement(4).centre[1], 0);
}

TEST(BlockSpace, MeasuresTheBoxEvenlyAndTheRestInReciprocals) {
  const BlockSpace open = makeSpace(3, 2, BackgroundBlockMode::own),
                   closed = makeSpace(3, 2, BackgroundBlockMode::none);
  EXPECT_EQ(closed.distanceAt(0.5, 2, 6), 4);
  EXPECT_EQ(open.distanceAt(0, 2, 6), 2);
  EXPECT_EQ(open.distanceAt(0.375, 2, 6), 4);
  EXPECT_EQ(open.distanceAt(0.75, 2, 6), 6);
  EXPECT_NEAR(open.distanceAt(0.875, 2, 6), 2 / (1 / 6.0 + 1e-6), 1e-9);
  EXPECT_NEAR(open.distanceAt(1, 2, 6), 1e6, 1e-3);
  for (const BlockSpace& space : {open, closed})
    for (double s = 0; s <= 1; s += 0.01) {
      EXPECT_NEAR(space.shareAt(space.distanceAt(s, 2, 6), 2, 6), s, 1e-12);
    }
}

class BlockSampling : public testing::TestWithParam<std::string> {};

// Rays through a space and their samples, on one device.
struct Sampled {
  BlockSpace space;
  uint32_t rays, intervals;
  bool split;
  std::vector<float> origins, directions, range, fences, farOfRay;
  std::vector<uint32_t> firstSample, block, firstSegment, firstOfSegment, groupOfSegment, rayOfSegment;
  std::vector<float> positions, distances, steps, middles, widths, runtimeSteps;
  uint32_t segments = 0;

  // Half of the rays begin inside or above the box and look down into it.
  Sampled(const std::string& device, const BlockSpace& through, bool cut, bool limited = false, uint64_t seed = 5)
      : space(through), rays(120), intervals(16), split(cut) {
    Stage stage(*deviceNamed(device), seed);
    origins = stage.random.floats(3 * rays, -5, 5);
    directions = stage.random.directions(rays);
    for (uint32_t r = 0; r < rays; r += 2) {
      origins[3 * r + 2] = r % 4 == 0 ? stage.random.uniform(-0.4f, 0.6f) : 1.5f;
      if (directions[3 * r + 2] > 0) directions[3 * r + 2] = -directions[3 * r + 2];
      for (int axis : {0, 1}) origins[3 * r + axis] *= 0.2f * static_cast<float>(axis ? space.rows : space.columns);
    }
    EnterScene enter{space};
    enter.rays = {rays};
    enter.intervals = intervals;
    enter.origins = stage.input(origins);
    enter.directions = stage.input(directions);
    enter.jitter = stage.randomInput(rays, 0, 1);
    enter.range = stage.output("range", 2 * rays);
    enter.fences = stage.output("fences", (intervals + 1) * rays);
    stage.device.run(enter);
    BlockSamples a{space};
    a.rays = {rays};
    a.intervals = intervals;
    a.split = split;
    a.origins = enter.origins;
    a.directions = enter.directions;
    a.range = enter.range;
    a.fences = enter.fences;
    if (limited) {
      farOfRay = stage.random.floats(rays, -0.2f, 1.3f);  // relative to the range, converted to distances below
      const std::vector<float> ends = stage.device.read(enter.range);
      for (uint32_t r = 0; r < rays; ++r) farOfRay[r] = ends[2 * r] + farOfRay[r] * (ends[2 * r + 1] - ends[2 * r]);
      a.farOfRay = stage.input(farOfRay);
    }
    const uint32_t rows = a.maxSamples(rays), maximum = a.maxSegments(rays);
    a.firstSample = stage.outputWords("firstSample", rays + 1);
    a.rowCount = stage.outputWords("rowCount", 1);
    a.blockOfSample = stage.outputWords("blockOfSample", rows);
    a.positions = stage.output("positions", 3 * rows);
    a.distances = stage.output("distances", rows);
    a.steps = stage.output("steps", rows);
    a.middles = stage.output("middles", rows);
    a.widths = stage.output("widths", rows);
    a.runtimeSteps = stage.output("runtimeSteps", rows);
    a.texels = 128;
    if (split) {
      a.firstSegment = stage.outputWords("firstSegment", rays + 1);
      a.segmentCount = stage.outputWords("segmentCount", 1);
      a.firstSampleOfSegment = stage.outputWords("firstSampleOfSegment", maximum + 1);
      a.groupOfSegment = stage.outputWords("groupOfSegment", maximum);
      a.rayOfSegment = stage.outputWords("rayOfSegment", maximum);
    }
    stage.device.run(a);
    const auto keep = [&](auto& values, const auto& slice, size_t count) {
      values = stage.device.read(slice);
      values.resize(count);
    };
    keep(range, enter.range, 2 * rays);
    keep(fences, enter.fences, (intervals + 1) * rays);
    keep(firstSample, a.firstSample, rays + 1);
    const size_t sampleCount = firstSample.back();
    EXPECT_EQ(stage.device.read(a.rowCount)[0], sampleCount);
    keep(block, a.blockOfSample, sampleCount);
    keep(positions, a.positions, 3 * sampleCount);
    keep(distances, a.distances, sampleCount);
    keep(steps, a.steps, sampleCount);
    keep(middles, a.middles, sampleCount);
    keep(widths, a.widths, sampleCount);
    keep(runtimeSteps, a.runtimeSteps, sampleCount);
    if (!split) return;
    keep(firstSegment, a.firstSegment, rays + 1);
    segments = stage.device.read(a.segmentCount)[0];
    keep(firstOfSegment, a.firstSampleOfSegment, segments + 1);
    keep(groupOfSegment, a.groupOfSegment, segments);
    keep(rayOfSegment, a.rayOfSegment, segments);
  }

  Triple<double> at(uint32_t ray, double t) const {
    Triple<double> x;
    for (int a = 0; a < 3; ++a) x[a] = origins[3 * ray + a] + t * directions[3 * ray + a];
    return x;
  }
  uint32_t blockAt(uint32_t ray, double t) const {
    const Triple<double> x = at(ray, t);
    return space.blockAt(x[0], x[1], x[2]);
  }
  // Both ends of a sample in t, computed from its position in s.
  std::pair<double, double> sampleEnds(uint32_t ray, uint32_t sample) const {
    const double half = 0.5 * widths[sample], near = range[2 * ray], far = range[2 * ray + 1];
    return {space.distanceAt(middles[sample] - half, near, far), space.distanceAt(middles[sample] + half, near, far)};
  }
};

TEST_P(BlockSampling, EntersAndLeavesTheBoxWhereTheRangeEnds) {
  for (const BlockSpace& space : kSpaces) {
    const Sampled s(GetParam(), space, false);
    int through = 0;
    for (uint32_t r = 0; r < s.rays; ++r) {
      const double near = s.range[2 * r], far = s.range[2 * r + 1];
      const auto isInside = [&](double t) {
        const Triple<double> x = s.at(r, t);
        return isInBox(space, x[0], x[1], x[2]);
      };
      ASSERT_GE(near, space.near);
      bool meets = false;
      for (double t = space.near; t < 30; t += 0.01) {
        const bool inside = isInside(t), within = t > near + 1e-4 && t < far - 1e-4;
        meets = meets || inside;
        if (inside) {
          EXPECT_TRUE(t > near - 1e-4 && t < far + 1e-4);
        } else if (within && isInside((near + far) / 2)) {
          ADD_FAILURE() << "the ray is outside the box within its range, at " << t;
        }
      }
      through += meets;
      if (meets || isInside((near + far) / 2)) continue;
      const Triple<double> o = s.at(r, 0);
      EXPECT_EQ(s.range[2 * r], space.near);
      EXPECT_NEAR(far - near, space.backgroundBlock == BackgroundBlockMode::none ? 0 : 1 + std::hypot(o[0], o[1], o[2]),
                  1e-5);
    }
    EXPECT_GT(through, 30);
    EXPECT_LT(through, 120);
  }
}

TEST_P(BlockSampling, LetsNoSampleStraddleBlocksAndMissesNothingOfTheRange) {
  for (const BlockSpace& space : kSpaces) {
    const Sampled s(GetParam(), space, true);
    for (uint32_t r = 0; r < s.rays; ++r) {
      double sum = 0, shares = 0;
      const double near = s.range[2 * r], far = s.range[2 * r + 1], length = far - near;
      for (uint32_t i = s.firstSample[r]; i < s.firstSample[r + 1]; ++i) {
        if (space.backgroundBlock == BackgroundBlockMode::none || s.middles[i] < 0.75f) sum += s.steps[i];
        shares += s.widths[i];
        const auto [from, to] = s.sampleEnds(r, i);
        if (to - from < 1e-4) continue;  // too short to be resolved in float
        for (double share : {0.01, 0.2, 0.5, 0.8, 0.99}) {
          EXPECT_EQ(s.blockAt(r, from + share * (to - from)), s.block[i])
              << spaceName(space) << ", ray " << r << ", sample " << i - s.firstSample[r] << ", " << share;
        }
      }
      EXPECT_NEAR(shares, 1, 1e-5);
      // An interval of the contracted border may extend across the end of the box, where it is not cut.
      if (space.backgroundBlock != BackgroundBlockMode::border) {
        EXPECT_NEAR(sum, length, 1e-4) << spaceName(space) << ", ray " << r;
      }
    }
  }
}

TEST_P(BlockSampling, CutsOnlyAtWallsAndExactlyThere) {
  for (const BlockSpace& space : kSpaces) {
    const Sampled whole(GetParam(), space, false), cut(GetParam(), space, true);
    ASSERT_EQ(whole.fences, cut.fences);
    EXPECT_EQ(whole.firstSample.back(), whole.rays * whole.intervals);
    size_t cuts = 0;
    for (uint32_t r = 0; r < cut.rays; ++r) {
      const double near = cut.range[2 * r], far = cut.range[2 * r + 1];
      const auto hasFenceAt = [&](const float s) {
        const auto from = cut.fences.begin() + r * (cut.intervals + 1);
        return std::any_of(from, from + cut.intervals + 1, [&](float fence) { return std::abs(fence - s) < 1e-6; });
      };
      for (uint32_t i = cut.firstSample[r]; i + 1 < cut.firstSample[r + 1]; ++i) {
        const double s = cut.middles[i] + 0.5 * cut.widths[i];
        if (hasFenceAt(static_cast<float>(s))) continue;
        ++cuts;
        const double t = space.distanceAt(s, near, far);
        if (s < 0.7499 && cut.steps[i] > 0) {  // farther away, floats are less precise
          const double end = cut.distances[i] + 0.5 * cut.steps[i];
          EXPECT_NEAR(t, end, 1e-4);
        }
        double apart = space.backgroundBlock == BackgroundBlockMode::own ? std::abs(s - 0.75) : 1;
        for (int axis : {0, 1}) {
          const int cells = static_cast<int>(axis == 0 ? space.columns : space.rows);
          for (int wall = 2 - cells; wall < cells; wall += 2)
            apart = std::min(apart, std::abs(cut.at(r, t)[axis] - wall) / std::max(1.0, t * t));
        }
        EXPECT_LT(apart, 1e-5) << spaceName(space) << ", ray " << r << ": a cut at " << t << " where no wall is";
      }
    }
    EXPECT_EQ(cuts > 0, space.blocks() > 1) << spaceName(space);
  }
}

TEST_P(BlockSampling, MakesSegmentsTheLongestRunsOfOneBlockInFrontToBackOrder) {
  for (const BlockSpace& space : kSpaces) {
    const Sampled s(GetParam(), space, true);
    EXPECT_EQ(s.firstSegment[0], 0u);
    EXPECT_EQ(s.firstSegment.back(), s.segments);
    EXPECT_EQ(s.firstOfSegment.back(), s.firstSample.back());
    size_t longest = 0;
    for (uint32_t r = 0; r < s.rays; ++r) {
      const std::vector<int> order = toBlockGrid(space).frontToBack(Vec2d(s.origins[3 * r], s.origins[3 * r + 1]));
      std::vector<size_t> places;
      ASSERT_EQ(s.firstOfSegment[s.firstSegment[r]], s.firstSample[r]);
      for (uint32_t segment = s.firstSegment[r]; segment < s.firstSegment[r + 1]; ++segment) {
        EXPECT_EQ(s.rayOfSegment[segment], r);
        ASSERT_LT(s.firstOfSegment[segment], s.firstOfSegment[segment + 1]);
        for (uint32_t i = s.firstOfSegment[segment]; i < s.firstOfSegment[segment + 1]; ++i)
          EXPECT_EQ(s.block[i], s.groupOfSegment[segment]);
        const int block = static_cast<int>(s.groupOfSegment[segment]);
        places.push_back(std::find(order.begin(), order.end(), block) -
                         order.begin());  // the background block comes last
      }
      for (size_t i = 1; i < places.size(); ++i)
        EXPECT_LT(places[i - 1], places[i])
            << spaceName(space) << ", ray " << r << ": not front to back, or a run in two";
      longest = std::max(longest, places.size());
    }
    EXPECT_GE(longest, std::min<size_t>(3, space.blocks())) << spaceName(space);
  }
}

TEST_P(BlockSampling, PutsPositionsIntoTheDomainOfTheBlockOfTheMiddle) {
  for (const BlockSpace& space : kSpaces) {
    const Sampled s(GetParam(), space, true);
    int outside = 0;
    for (uint32_t r = 0; r < s.rays; ++r)
      for (uint32_t i = s.firstSample[r]; i < s.firstSample[r + 1]; ++i) {
        const Triple<double> x = s.at(r, s.distances[i]);
        const BlockSpace::Placement place = space.placement(s.block[i]);
        Triple<double> q, d;
        for (int a = 0; a < 3; ++a) {
          q[a] = (x[a] - place.centre[a]) / place.scale[a];
          d[a] = s.directions[3 * r + a] / place.scale[a];
        }
        const Triple<double> y = place.contracted ? contract(q) : q,
                             dy = place.contracted ? contractDirection(q, d) : d;
        bool inside = true;
        for (int a = 0; a < 3; ++a) {
          const double u = (y[a] / place.halfDomain() + 1) / 2;
          inside = inside && u >= 0 && u <= 1;
          EXPECT_NEAR(s.positions[3 * i + a], std::clamp(u, 0.0, 1.0), 2e-6);
        }
        const bool isEmpty = s.range[2 * r] == s.range[2 * r + 1];
        outside += !inside;
        if (!inside || isEmpty) {
          EXPECT_EQ(s.steps[i], 0);
        } else if (s.widths[i] > 1e-5f) {
          EXPECT_GT(s.steps[i], 0);
        }
        if (s.distances[i] < 10) {  // the step is one texel of the domain
          const double texel = s.runtimeSteps[i] * std::hypot(dy[0], dy[1], dy[2]);
          EXPECT_NEAR(texel, 2 * place.halfDomain() / 128, 1e-4 * texel);
        }
      }
    if (space.backgroundBlock == BackgroundBlockMode::own) {
      EXPECT_EQ(outside, 0);
    }
    if (space.backgroundBlock == BackgroundBlockMode::border) {
      EXPECT_GT(outside, 0) << "no ray over an inner cell";
    }
  }
}

TEST_P(BlockSampling, CutsStepsOffAtTheEndOfARayAndLeavesMiddles) {
  for (const BlockSpace& space : kSpaces) {
    const Sampled whole(GetParam(), space, true), limited(GetParam(), space, true, true);
    EXPECT_EQ(whole.distances, limited.distances);
    EXPECT_EQ(whole.positions, limited.positions);
    EXPECT_EQ(whole.widths, limited.widths);
    int shortened = 0;
    for (uint32_t r = 0; r < whole.rays; ++r)
      for (uint32_t i = whole.firstSample[r]; i < whole.firstSample[r + 1]; ++i) {
        const double from = whole.distances[i] - 0.5 * whole.steps[i], to = from + whole.steps[i];
        const double far = limited.farOfRay[r], remaining = std::max(0.0, std::min(to, far) - std::min(from, far));
        EXPECT_NEAR(limited.steps[i], remaining, 1e-6 * std::max(10.0, to));
        shortened += remaining > 0 && remaining < whole.steps[i];
      }
    EXPECT_GT(shortened, 10);
  }
}

TEST_P(BlockSampling, SpreadsPointsEvenlyOverTheDomainsOfTheBlocksChosen) {
  for (const BlockSpace& space : kSpaces) {
    Stage stage(*deviceNamed(GetParam()), 6);
    BlockPoints a{space};
    a.points = 20000;
    a.seed = 99;
    a.texels = 128;
    const std::vector<uint32_t> blocks = {0, space.blocks() - 1};
    a.blocks = stage.input(blocks);
    a.blockOfSample = stage.outputWords("blockOfSample", a.points);
    a.positions = stage.output("positions", 3 * a.points);
    a.runtimeSteps = stage.output("runtimeSteps", a.points);
    stage.device.run(a);
    const std::vector<uint32_t> block = stage.device.read(a.blockOfSample);
    const std::vector<float> positions = stage.device.read(a.positions), steps = stage.device.read(a.runtimeSteps);
    const double ofFirst = static_cast<double>(std::count(block.begin(), block.end(), 0u)) / a.points;
    EXPECT_NEAR(ofFirst, space.blocks() == 1 ? 1 : 0.5, 0.02);
    double sums[3] = {0, 0, 0};
    for (uint32_t p = 0; p < a.points; ++p) {
      const BlockSpace::Placement place = space.placement(block[p]);
      ASSERT_TRUE(block[p] == blocks[0] || block[p] == blocks[1]);
      for (int axis = 0; axis < 3; ++axis) {
        const float u = positions[3 * p + axis];
        const bool high = axis == 2 && !place.contracted;
        sums[axis] += high ? (2 * u - 1 - space.bottom) / (space.top - space.bottom) : u;
        ASSERT_GE(u, high ? (space.bottom + 1) / 2 - 1e-6f : 0);
        ASSERT_LE(u, high ? (space.top + 1) / 2 + 1e-6f : 1);
      }
      if (place.contracted) {
        ASSERT_TRUE(std::isfinite(steps[p]));
        ASSERT_GE(steps[p], 4.0 / 128 / 1.9319 * 0.999);
      } else {
        ASSERT_NEAR(steps[p], 2.0 / 128, 1e-7);
      }
    }
    for (double sum : sums) EXPECT_NEAR(sum / a.points, 0.5, 0.01);
  }
}

TEST_P(BlockSampling, GroupsRowsByBlockAndScattersThemBack) {
  Stage stage(*deviceNamed(GetParam()), 7);
  const uint32_t rows = 9001, blocks = 7;
  const std::vector<uint32_t> block = stage.random.wordsBelow(rows, blocks - 1);  // the last block has no rows
  const std::vector<float> values = stage.random.floats(rows, 0, 1);
  GroupByBlock group;
  group.samples = {rows};
  group.blocks = blocks;
  group.blockOfSample = stage.input(block);
  group.firstOfBlock = stage.outputWords("firstOfBlock", blocks + 1);
  group.source = stage.outputWords("source", rows);
  stage.device.run(group);
  const std::vector<uint32_t> first = stage.device.read(group.firstOfBlock), source = stage.device.read(group.source);
  EXPECT_EQ(first[0], 0u);
  EXPECT_EQ(first[blocks - 1], rows);
  EXPECT_EQ(first[blocks], rows);
  for (uint32_t b = 0; b < blocks; ++b)
    for (uint32_t i = first[b]; i < first[b + 1]; ++i) {
      ASSERT_EQ(block[source[i]], b);
      ASSERT_TRUE(i == first[b] || source[i - 1] < source[i]);
    }
  const Slice<float> grouped = stage.output("grouped", rows), back = stage.output("back", rows);
  stage.device.run(GatherRows{{rows}, group.source, Matrix<float>(stage.input(values), 1), Matrix<float>(grouped, 1)});
  stage.device.run(ScatterRows{{rows}, group.source, Matrix<float>(grouped, 1), Matrix<float>(back, 1)});
  EXPECT_NE(stage.device.read(grouped), values);
  EXPECT_EQ(stage.device.read(back), values);
}

INSTANTIATE_TEST_SUITE_P(Devices, BlockSampling, testing::Values("reference", "cpu with 2 threads"),
                         [](const auto& info) { return info.param.substr(0, info.param.find(' ')); });

}  // namespace
}  // namespace tessera::device_test

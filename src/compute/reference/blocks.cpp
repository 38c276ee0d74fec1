#include "compute/blocks.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <numbers>

#include "base/random.h"
#include "compute/reference/convert.h"
#include "compute/reference/functions.h"
#include "scene/contraction.h"

namespace tessera::reference {
namespace {

double length(const Point& x) {
  return std::hypot(x[0], x[1], x[2]);
}

Point toLocalPoint(const BlockSpace::Placement& placement, const Point& x) {
  Point q;
  for (int a = 0; a < 3; ++a) q[a] = (x[a] - placement.centre[a]) / placement.scale[a];
  return q;
}

// The length in t of one texel along `direction` at the local coordinates q; 0 if the direction is zero.
double runtimeStepAt(const BlockSpace::Placement& placement, uint32_t texels, const Point& q, const Point& direction) {
  Point along;
  for (int a = 0; a < 3; ++a) along[a] = direction[a] / placement.scale[a];
  if (placement.contracted) along = contractDirection(q, along);
  const double speed = length(along);
  return speed > 0 && texels > 0 ? 2.0 * placement.halfDomain() / texels / speed : 0;
}

struct Post {
  double s, t;
};

// The ends of all intervals: the fences and, with `split`, the cuts at walls.
std::vector<Post> listPosts(const BlockSpace& space, const FencedRay& ray, bool split) {
  std::vector<Post> posts;
  for (double s : ray.fences) posts.push_back({s, space.distanceAt(s, ray.near, ray.far)});
  if (!split || ray.direction == Point{}) return posts;
  Doubles cuts;
  for (int axis : {0, 1}) {
    const int cells = static_cast<int>(axis == 0 ? space.columns : space.rows);
    for (int wall = 2 - cells; wall < cells && ray.direction[axis] != 0; wall += 2)
      cuts.push_back((wall - ray.origin[axis]) / ray.direction[axis]);
  }
  if (space.backgroundBlock == BackgroundBlockMode::own) cuts.push_back(ray.far);
  for (double t : cuts) {
    const double s = space.shareAt(t, ray.near, ray.far);
    const auto next =
        std::upper_bound(posts.begin(), posts.end(), s, [](double a, const Post& post) { return a < post.s; });
    if (next == posts.begin() || next == posts.end() || (next - 1)->s == s) continue;
    posts.insert(next, {s, t});
  }
  return posts;
}

}  // namespace

std::array<double, 2> rangeInScene(const BlockSpace& space, const Point& origin, const Point& direction,
                                   double nearOfRay) {
  const double near = std::max<double>(space.near, nearOfRay);
  if (direction == Point{}) return {near, near};
  const double low[3] = {-1.0 * space.columns, -1.0 * space.rows, space.bottom};
  const double high[3] = {1.0 * space.columns, 1.0 * space.rows, space.top};
  double enter = near, leave = std::numeric_limits<double>::infinity();
  for (int a = 0; a < 3; ++a) {
    if (direction[a] == 0) {
      if (origin[a] < low[a] || origin[a] > high[a]) leave = 0;
      continue;
    }
    const double toLow = (low[a] - origin[a]) / direction[a], toHigh = (high[a] - origin[a]) / direction[a];
    enter = std::max(enter, std::min(toLow, toHigh));
    leave = std::min(leave, std::max(toLow, toHigh));
  }
  if (enter < leave) return {enter, leave};
  return {near, space.backgroundBlock == BackgroundBlockMode::none ? near : near + 1 + length(origin)};
}

Doubles firstFences(uint32_t intervals, double jitter) {
  Doubles fences{0};
  for (uint32_t i = 1; i < intervals; ++i) fences.push_back((i + jitter - 0.5) / intervals);
  fences.push_back(1);
  return fences;
}

std::vector<BlockSample> blockSamples(const BlockSpace& space, const FencedRay& ray, bool split, uint32_t texels) {
  const std::vector<Post> posts = listPosts(space, ray, split);
  std::vector<BlockSample> samples;
  for (size_t i = 0; i + 1 < posts.size(); ++i) {
    const Post &from = posts[i], &to = posts[i + 1];
    BlockSample sample;
    sample.distance = (from.t + to.t) / 2;
    Point x;
    for (int a = 0; a < 3; ++a) x[a] = ray.origin[a] + sample.distance * ray.direction[a];
    sample.block = space.blockAt(x[0], x[1], x[2]);
    const BlockSpace::Placement placement = space.placement(sample.block);
    const Point q = toLocalPoint(placement, x), y = placement.contracted ? contract(q) : q;
    const double half = placement.halfDomain();
    bool inside = true;
    for (int a = 0; a < 3; ++a) {
      inside = inside && std::abs(y[a]) <= half;
      sample.position[a] = std::clamp((y[a] + half) / (2 * half), 0.0, 1.0);
    }
    if (inside && ray.direction != Point{})
      sample.step = std::max(0.0, std::min(to.t, ray.farthest) - std::min(from.t, ray.farthest));
    sample.middle = (from.s + to.s) / 2;
    sample.width = to.s - from.s;
    sample.runtimeStep = runtimeStepAt(placement, texels, q, ray.direction);
    samples.push_back(sample);
  }
  return samples;
}

BlockPoint blockPoint(const BlockSpace& space, Indices blocks, uint32_t texels, uint64_t seed, uint32_t point) {
  const RandomStream random(seed, 0x5ba);
  const uint64_t first = 8 * uint64_t{point};
  BlockPoint result;
  result.block = blocks[random.below(first, static_cast<uint32_t>(blocks.size()))];
  const BlockSpace::Placement placement = space.placement(result.block);
  const double half = placement.halfDomain();
  Point y;
  for (int a = 0; a < 3; ++a) {
    const double u = random.uniform(first + 1 + a);
    y[a] = half * (2 * u - 1);
    if (a == 2 && !placement.contracted) y[a] = space.bottom + u * (static_cast<double>(space.top) - space.bottom);
    result.position[a] = (y[a] + half) / (2 * half);
  }
  const double z = 2.0 * random.uniform(first + 4) - 1, angle = 2 * std::numbers::pi * random.uniform(first + 5);
  const double across = std::sqrt(1 - z * z);
  const double maximum = half - 1 / BlockSpace::kFarthest;
  for (double& coordinate : y) coordinate = std::clamp(coordinate, -maximum, maximum);
  result.runtimeStep = runtimeStepAt(placement, texels, placement.contracted ? uncontract(y) : y,
                                     {across * std::cos(angle), across * std::sin(angle), z});
  return result;
}

void run(const EnterScene& a) {
  const size_t rays = hostCount(a.rays);
  const Doubles origins = doubles(a.origins, 3 * rays), directions = doubles(a.directions, 3 * rays);
  const Doubles jitter = doubles(a.jitter, rays), nears = doubles(a.nearOfRay, rays);
  Doubles range, fences;
  for (size_t r = 0; r < rays; ++r) {
    const auto ofRay =
        rangeInScene(a.space, {origins[3 * r], origins[3 * r + 1], origins[3 * r + 2]},
                     {directions[3 * r], directions[3 * r + 1], directions[3 * r + 2]}, nears.empty() ? 0 : nears[r]);
    range.insert(range.end(), ofRay.begin(), ofRay.end());
    const Doubles first = firstFences(a.intervals, jitter.empty() ? 0.5 : jitter[r]);
    fences.insert(fences.end(), first.begin(), first.end());
  }
  store(a.range, range);
  store(a.fences, fences);
}

void run(const BlockSamples& a) {
  const size_t rays = hostCount(a.rays), posts = a.intervals + size_t{1};
  const Doubles origins = doubles(a.origins, 3 * rays), directions = doubles(a.directions, 3 * rays);
  const Doubles range = doubles(a.range, 2 * rays), farOfRay = doubles(a.farOfRay, rays);
  const Doubles fences = doubles(a.fences, posts * rays);
  const Indices groups = indices(a.groupOfBlock, a.groupOfBlock.count);
  const Indices slots = indices(a.slotOfBlock, a.slotOfBlock.count);
  Doubles positions, distances, steps, middles, widths, runtimeSteps;
  std::vector<uint32_t> firstSample{a.firstRow}, blocks, firstSegment{0}, firstSampleOfSegment, groupOfSegment,
      rayOfSegment;
  for (size_t r = 0; r < rays; ++r) {
    FencedRay ray{{origins[3 * r], origins[3 * r + 1], origins[3 * r + 2]},
                  {directions[3 * r], directions[3 * r + 1], directions[3 * r + 2]},
                  range[2 * r],
                  range[2 * r + 1]};
    if (!farOfRay.empty()) ray.farthest = farOfRay[r];
    ray.fences.assign(fences.begin() + r * posts, fences.begin() + (r + 1) * posts);
    bool first = true;
    for (BlockSample& sample : blockSamples(a.space, ray, a.split, a.texels)) {
      if (!slots.empty()) {
        const bool hasSlot = slots[sample.block] != kNoSlot;
        sample.block = hasSlot ? slots[sample.block] : 0;
        if (!hasSlot) sample.step = 0;
      }
      const uint32_t group = groups.empty() ? sample.block : groups[sample.block];
      if (first || group != groupOfSegment.back()) {
        firstSampleOfSegment.push_back(a.firstRow + static_cast<uint32_t>(blocks.size()));
        groupOfSegment.push_back(group);
        rayOfSegment.push_back(static_cast<uint32_t>(r));
      }
      first = false;
      blocks.push_back(sample.block);
      positions.insert(positions.end(), sample.position.begin(), sample.position.end());
      distances.push_back(sample.distance);
      steps.push_back(sample.step);
      middles.push_back(sample.middle);
      widths.push_back(sample.width);
      runtimeSteps.push_back(sample.runtimeStep);
    }
    firstSample.push_back(a.firstRow + static_cast<uint32_t>(blocks.size()));
    firstSegment.push_back(static_cast<uint32_t>(groupOfSegment.size()));
  }
  firstSampleOfSegment.push_back(firstSample.back());
  const size_t sampleCount = blocks.size();
  const auto rows = [&](const Slice<float>& slice, size_t columns) {
    return slice && sampleCount > 0 ? slice.part(a.firstRow * columns, sampleCount * columns) : Slice<float>();
  };
  store(a.firstSample, firstSample);
  *hostPointer(a.rowCount) = firstSample.back();
  if (sampleCount > 0) store(a.blockOfSample.part(a.firstRow, sampleCount), blocks);
  store(rows(a.positions, 3), positions);
  store(rows(a.distances, 1), distances);
  store(rows(a.steps, 1), steps);
  store(rows(a.middles, 1), middles);
  store(rows(a.widths, 1), widths);
  store(rows(a.runtimeSteps, 1), runtimeSteps);
  if (!a.split) return;
  store(a.firstSegment, firstSegment);
  *hostPointer(a.segmentCount) = firstSegment.back();
  store(a.firstSampleOfSegment, firstSampleOfSegment);
  store(a.groupOfSegment, groupOfSegment);
  store(a.rayOfSegment, rayOfSegment);
}

void run(const BlockPoints& a) {
  const Indices blocks = indices(a.blocks, a.blocks.count), slots = indices(a.slotOfBlock, a.slotOfBlock.count);
  if (a.points > 0) CHECK(a.blocks.count > 0u);
  std::vector<uint32_t> blockOfSample;
  Doubles positions, runtimeSteps;
  for (uint32_t p = 0; p < a.points; ++p) {
    const BlockPoint point = blockPoint(a.space, blocks, a.texels, a.seed, p);
    blockOfSample.push_back(slots.empty() ? point.block : slots[point.block]);
    positions.insert(positions.end(), point.position.begin(), point.position.end());
    runtimeSteps.push_back(point.runtimeStep);
  }
  store(a.blockOfSample, blockOfSample);
  store(a.positions, positions);
  store(a.runtimeSteps, runtimeSteps);
}

void run(const GroupByBlock& a) {
  const Indices blockOfSample = indices(a.blockOfSample, hostCount(a.samples));
  std::vector<uint32_t> first{0}, source;
  for (uint32_t block = 0; block < a.blocks; ++block) {
    for (uint32_t row = 0; row < blockOfSample.size(); ++row)
      if (blockOfSample[row] == block) source.push_back(row);
    first.push_back(static_cast<uint32_t>(source.size()));
  }
  CHECK(source.size() == blockOfSample.size());  // no sample has an invalid block
  store(a.firstOfBlock, first);
  store(a.source, source);
}

}  // namespace tessera::reference

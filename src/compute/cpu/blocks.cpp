#include "compute/blocks.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <numbers>
#include <vector>

#include "base/random.h"
#include "compute/cpu/kernels.h"
#include "compute/host_memory.h"
#include "scene/contraction.h"

namespace tessera::cpu {
namespace {

constexpr size_t kRaysPerTask = 64;
constexpr size_t kRowsPerTask = 4096;

// The positions in the scene of the middles of a ray's samples, and scratch space for one more number per sample.
struct Middles {
  std::vector<double> x, y, z, squares;

  explicit Middles(size_t maximum) : x(maximum), y(maximum), z(maximum), squares(maximum) {}
};

// Precomputes the values of a BlockSpace that each sample needs.
class Blocks {
 public:
  struct Place {
    double centre[3], inverseScale[3], half, texel;
    bool contracted;
  };

  Blocks(const BlockSpace& space, uint32_t texels) : space_(space) {
    for (uint32_t block = 0; block < space.blocks(); ++block) {
      const BlockSpace::Placement placement = space.placement(block);
      Place& place = places_.emplace_back();
      for (int a = 0; a < 3; ++a) {
        place.centre[a] = placement.centre[a];
        place.inverseScale[a] = 1.0 / placement.scale[a];
      }
      place.half = placement.halfDomain();
      place.texel = texels > 0 ? 2 * place.half / texels : 0;
      place.contracted = placement.contracted;
    }
  }

  // BlockSpace::blockAt for `count` points.
  void find(const Middles& at, uint32_t count, uint32_t* block) const {
    const double *const xs = at.x.data(), *const ys = at.y.data(), *const zs = at.z.data();
    const double width = space_.columns, depth = space_.rows, bottom = space_.bottom, top = space_.top;
    const int32_t columns = static_cast<int32_t>(space_.columns), cells = static_cast<int32_t>(space_.cells());
    const bool inside = space_.backgroundBlock != BackgroundBlockMode::own;
    for (uint32_t i = 0; i < count; ++i) {
      const double x = xs[i], y = ys[i], z = zs[i];
      const bool inBox = (std::abs(x) <= width) & (std::abs(y) <= depth) & (z >= bottom) & (z <= top);
      const auto column = static_cast<int32_t>(std::max(0.0, std::min((x + width) / 2, width - 1)));
      const auto row = static_cast<int32_t>(std::max(0.0, std::min((y + depth) / 2, depth - 1)));
      const int32_t cell = column + columns * row;
      block[i] = static_cast<uint32_t>(inside | inBox ? cell : cells);
    }
  }
  const Place& place(uint32_t block) const { return places_[block]; }

 private:
  const BlockSpace& space_;
  std::vector<Place> places_;
};

// Reimplements scene/contraction.h for millions of samples, with selections instead of branches so that compilers can
// vectorise it.
struct Contraction {
  double x, y, z;              // contracted
  double inverse;              // 1 / max(1, m)
  double signX, signY, signZ;  // of the coordinate, for the farthest one outside the cube; else 0

  Contraction(double qx, double qy, double qz) {
    const double ax = std::abs(qx), ay = std::abs(qy), az = std::abs(qz), m = std::max(ax, std::max(ay, az));
    const double one = m > 1 ? 1.0 : 0.0;
    inverse = 1 / std::max(1.0, m);
    const double oneY = ax == m ? 0.0 : one, oneZ = ay == m ? 0.0 : oneY;
    signX = std::copysign(ax == m ? one : 0.0, qx);
    signY = std::copysign(ay == m ? oneY : 0.0, qy);
    signZ = std::copysign(oneZ, qz);
    // q · inverse is ±1 along the farthest axis.
    const double more = 1 - inverse;
    x = qx * inverse + signX * more;
    y = qy * inverse + signY * more;
    z = qz * inverse + signZ * more;
  }
  // The squared length of contractDirection(q, d). With g the derivative of m along d, its components are
  // (d - q g / m) / m, which vanishes along the farthest axis, and g / m² along that axis.
  double squareSpeed(double qx, double qy, double qz, double dx, double dy, double dz) const {
    const double radial = (signX * dx + signY * dy + signZ * dz) * (inverse * inverse);
    const double vx = dx * inverse - qx * radial, vy = dy * inverse - qy * radial, vz = dz * inverse - qz * radial;
    return vx * vx + vy * vy + vz * vz + radial * radial;
  }
};

struct Ray {
  double origin[3], direction[3], near, far, farthest;
  const float* fences;

  Ray(const BlockSamples& a, size_t ray) : fences(hostPointer(a.fences) + ray * (a.intervals + size_t{1})) {
    for (int axis = 0; axis < 3; ++axis) {
      origin[axis] = hostPointer(a.origins)[3 * ray + axis];
      direction[axis] = hostPointer(a.directions)[3 * ray + axis];
    }
    near = hostPointer(a.range)[2 * ray];
    far = hostPointer(a.range)[2 * ray + 1];
    farthest = a.farOfRay ? hostPointer(a.farOfRay)[ray] : std::numeric_limits<double>::infinity();
  }
  bool exists() const { return direction[0] != 0 || direction[1] != 0 || direction[2] != 0; }
};

// A wall that a ray crosses inside one of its intervals.
struct Cut {
  double s, t;
  uint32_t interval;
};

// Finds the cuts of a ray, front to back and without duplicates.
void findCuts(const BlockSamples& a, const Ray& ray, std::vector<Cut>& cuts) {
  cuts.clear();
  if (!a.split || !ray.exists()) return;
  const float* const end = ray.fences + a.intervals + 1;
  const auto consider = [&](double t) {
    const double s = a.space.shareAt(t, ray.near, ray.far);
    const float* const next = std::upper_bound(ray.fences, end, s);
    if (next == ray.fences || next == end || next[-1] == s) return;
    const auto place =
        std::lower_bound(cuts.begin(), cuts.end(), s, [](const Cut& cut, double b) { return cut.s < b; });
    if (place != cuts.end() && place->s == s) return;
    cuts.insert(place, {s, t, static_cast<uint32_t>(next - 1 - ray.fences)});
  };
  for (int axis : {0, 1}) {
    const int cells = static_cast<int>(axis == 0 ? a.space.columns : a.space.rows);
    const double o = ray.origin[axis], d = ray.direction[axis];
    if (d == 0) continue;
    for (int wall = 2 - cells; wall < cells; wall += 2) {
      const double t = (wall - o) / d;
      if (t > 0) consider(t);
    }
  }
  if (a.space.backgroundBlock == BackgroundBlockMode::own) consider(ray.far);
}

// Computes the ends of all intervals of a ray, including the cuts; s and t have one element more than there are
// samples. Returns the number of samples.
uint32_t findEnds(const BlockSamples& a, const Ray& ray, const std::vector<Cut>& cuts, double* s, double* t) {
  constexpr double kShare = BlockSpace::kBoxShare;
  const uint32_t posts = a.intervals + 1, samples = a.intervals + static_cast<uint32_t>(cuts.size());
  // Each fence is moved back by the number of cuts in front of it.
  uint32_t done = 0;
  for (size_t c = 0; c <= cuts.size(); ++c) {
    const uint32_t stop = c < cuts.size() ? cuts[c].interval + 1 : posts;
    for (; done < stop; ++done) s[done + c] = ray.fences[done];
    if (c == cuts.size()) break;
    s[done + c] = cuts[c].s;
  }
  // BlockSpace::distanceAt in two loops without branches.
  const double length = ray.far - ray.near;
  if (a.space.backgroundBlock == BackgroundBlockMode::none) {
    for (uint32_t i = 0; i <= samples; ++i) t[i] = ray.near + s[i] * length;
  } else {
    const auto inBox = static_cast<uint32_t>(std::upper_bound(s, s + samples + 1, kShare) - s);
    for (uint32_t i = 0; i < inBox; ++i) t[i] = ray.near + s[i] / kShare * length;
    for (uint32_t i = inBox; i <= samples; ++i) {
      const double u = (s[i] - kShare) / (1 - kShare);
      t[i] = 1 / ((1 - u) / ray.far + u / BlockSpace::kFarthest);
    }
  }
  for (size_t c = 0; c < cuts.size(); ++c) t[cuts[c].interval + 1 + c] = cuts[c].t;  // the exact distances
  return samples;
}

void findMiddles(const Ray& ray, const double* t, uint32_t samples, Middles& at, float* __restrict distances,
                 float* __restrict steps) {
  double* __restrict xs = at.x.data();
  double* __restrict ys = at.y.data();
  double* __restrict zs = at.z.data();
  const double ox = ray.origin[0], oy = ray.origin[1], oz = ray.origin[2];
  const double dx = ray.direction[0], dy = ray.direction[1], dz = ray.direction[2];
  const double farthest = ray.exists() ? ray.farthest : 0;  // where steps are cut off
  for (uint32_t i = 0; i < samples; ++i) {
    const double middle = (t[i] + t[i + 1]) / 2;
    xs[i] = ox + middle * dx;
    ys[i] = oy + middle * dy;
    zs[i] = oz + middle * dz;
    distances[i] = static_cast<float>(middle);
    steps[i] = static_cast<float>(std::max(0.0, std::min(t[i + 1], farthest) - std::min(t[i], farthest)));
  }
}

// Writes the rows of one ray in one bounded block; row i belongs to middle `first + i`.
void writeBounded(const Blocks::Place& place, const Middles& at, uint32_t first, uint32_t count,
                  float* __restrict positions, float* __restrict steps) {
  const double *const xs = at.x.data() + first, *const ys = at.y.data() + first, *const zs = at.z.data() + first;
  const double cx = place.centre[0], cy = place.centre[1], cz = place.centre[2];
  for (uint32_t i = 0; i < count; ++i) {
    const double x = xs[i] - cx, y = ys[i] - cy, z = zs[i] - cz;
    const double m = std::max(std::abs(x), std::max(std::abs(y), std::abs(z)));
    steps[i] = m > 1 ? 0 : steps[i];
    positions[3 * i] = static_cast<float>(std::min(1.0, std::max(0.0, x * 0.5 + 0.5)));
    positions[3 * i + 1] = static_cast<float>(std::min(1.0, std::max(0.0, y * 0.5 + 0.5)));
    positions[3 * i + 2] = static_cast<float>(std::min(1.0, std::max(0.0, z * 0.5 + 0.5)));
  }
}

// Writes the rows of one ray in one contracted block; `along` is the direction in its local coordinates. Replaces the
// middles in `at` by the contracted middles.
void writeContracted(const Blocks::Place& place, Middles& at, uint32_t first, uint32_t count, const double along[3],
                     float* __restrict positions, float* __restrict runtimeSteps) {
  double* __restrict xs = at.x.data() + first;
  double* __restrict ys = at.y.data() + first;
  double* __restrict zs = at.z.data() + first;
  double* __restrict squares = at.squares.data() + first;
  const double cx = place.centre[0], cy = place.centre[1], cz = place.centre[2];
  const double sx = place.inverseScale[0], sy = place.inverseScale[1], sz = place.inverseScale[2];
  const double dx = along[0], dy = along[1], dz = along[2], texel = place.texel;
  for (uint32_t i = 0; i < count; ++i) {
    const double x = (xs[i] - cx) * sx, y = (ys[i] - cy) * sy, z = (zs[i] - cz) * sz;
    const Contraction contraction(x, y, z);
    squares[i] = contraction.squareSpeed(x, y, z, dx, dy, dz);
    xs[i] = contraction.x;
    ys[i] = contraction.y;
    zs[i] = contraction.z;
  }
  if (runtimeSteps) {
    for (uint32_t i = 0; i < count; ++i) runtimeSteps[i] = static_cast<float>(texel / std::sqrt(squares[i]));
  }
  for (uint32_t i = 0; i < count; ++i) {
    positions[3 * i] = static_cast<float>(xs[i] * 0.25 + 0.5);
    positions[3 * i + 1] = static_cast<float>(ys[i] * 0.25 + 0.5);
    positions[3 * i + 2] = static_cast<float>(zs[i] * 0.25 + 0.5);
  }
}

// Writes the rows of one ray; returns the number of its segments.
uint32_t writeSamples(const BlockSamples& a, const Blocks& blocks, const Ray& ray, const double* s, const double* t,
                      uint32_t samples, size_t row, Middles& at) {
  const uint32_t* const groups = hostPointer(a.groupOfBlock);
  const uint32_t* const slots = hostPointer(a.slotOfBlock);
  uint32_t* const blockOfSample = hostPointer(a.blockOfSample) + row;
  float* const positions = hostPointer(a.positions) + 3 * row;
  float* const distances = hostPointer(a.distances) + row;
  float* const steps = hostPointer(a.steps) + row;
  float* const middles = a.middles ? hostPointer(a.middles) + row : nullptr;
  float* const widths = a.widths ? hostPointer(a.widths) + row : nullptr;
  float* const runtimeSteps = a.runtimeSteps ? hostPointer(a.runtimeSteps) + row : nullptr;
  findMiddles(ray, t, samples, at, distances, steps);
  for (uint32_t i = 0; middles && i < samples; ++i) middles[i] = static_cast<float>((s[i] + s[i + 1]) / 2);
  for (uint32_t i = 0; widths && i < samples; ++i) widths[i] = static_cast<float>(s[i + 1] - s[i]);
  blocks.find(at, samples, blockOfSample);
  uint32_t segments = 0, lastGroup = 0;
  for (uint32_t first = 0, end = 0; first < samples; first = end) {
    const uint32_t block = blockOfSample[first];
    while (end < samples && blockOfSample[end] == block) ++end;
    const Blocks::Place& place = blocks.place(block);
    double along[3];  // the direction in local coordinates
    for (int axis = 0; axis < 3; ++axis) along[axis] = ray.direction[axis] * place.inverseScale[axis];
    if (place.contracted) {
      writeContracted(place, at, first, end - first, along, positions + 3 * first,
                      runtimeSteps ? runtimeSteps + first : nullptr);
    } else {
      writeBounded(place, at, first, end - first, positions + 3 * first, steps + first);
    }
    if (runtimeSteps && !(place.contracted && ray.exists())) {
      const double speed = std::sqrt(along[0] * along[0] + along[1] * along[1] + along[2] * along[2]);
      std::fill(runtimeSteps + first, runtimeSteps + end, speed > 0 ? static_cast<float>(place.texel / speed) : 0);
    }
    uint32_t name = block;
    if (slots) {
      const bool hasSlot = slots[block] != kNoSlot;
      name = hasSlot ? slots[block] : 0;
      std::fill(blockOfSample + first, blockOfSample + end, name);
      if (!hasSlot) std::fill(steps + first, steps + end, 0.0f);
    }
    const uint32_t group = groups ? groups[name] : name;
    segments += first == 0 || group != lastGroup;
    lastGroup = group;
  }
  return segments;
}

// Converts the counts in offsets[1 .. n] to running ends, beginning at `start`.
void countsToOffsets(uint32_t* offsets, size_t n, uint32_t start) {
  offsets[0] = start;
  for (size_t i = 0; i < n; ++i) offsets[i + 1] += offsets[i];
}

// Writes the segments of all rays; `firstSegment` already contains the offsets from the number of segments per ray.
void writeSegments(Context& context, const BlockSamples& a, size_t rays) {
  const uint32_t* firstSample = hostPointer(a.firstSample);
  const uint32_t* firstSegment = hostPointer(a.firstSegment);
  const uint32_t* blockOfSample = hostPointer(a.blockOfSample);
  const uint32_t* groups = hostPointer(a.groupOfBlock);
  const auto sampleGroup = [&](uint32_t sample) {
    return groups ? groups[blockOfSample[sample]] : blockOfSample[sample];
  };
  uint32_t* firstSampleOfSegment = hostPointer(a.firstSampleOfSegment);
  uint32_t* groupOfSegment = hostPointer(a.groupOfSegment);
  uint32_t* rayOfSegment = hostPointer(a.rayOfSegment);
  *hostPointer(a.segmentCount) = firstSegment[rays];
  firstSampleOfSegment[firstSegment[rays]] = firstSample[rays];
  context.pool.forRanges(rays, 4 * kRaysPerTask, [&](size_t begin, size_t end) {
    for (size_t ray = begin; ray < end; ++ray) {
      uint32_t segment = firstSegment[ray];
      for (uint32_t i = firstSample[ray]; i < firstSample[ray + 1]; ++i) {
        if (i > firstSample[ray] && sampleGroup(i) == sampleGroup(i - 1)) continue;
        firstSampleOfSegment[segment] = i;
        groupOfSegment[segment] = sampleGroup(i);
        rayOfSegment[segment++] = static_cast<uint32_t>(ray);
      }
    }
  });
}

}  // namespace

void run(Context& context, const EnterScene& a) {
  const BlockSpace& space = a.space;
  const float* origins = hostPointer(a.origins);
  const float* directions = hostPointer(a.directions);
  const float* jitter = hostPointer(a.jitter);
  const float* nearOfRay = hostPointer(a.nearOfRay);
  float* range = hostPointer(a.range);
  float* fences = hostPointer(a.fences);
  const double perInterval = 1.0 / a.intervals;
  context.pool.forRanges(hostCount(a.rays), kRaysPerTask, [&](size_t begin, size_t end) {
    for (size_t ray = begin; ray < end; ++ray) {
      const float* o = origins + 3 * ray;
      const float* d = directions + 3 * ray;
      const bool exists = d[0] != 0 || d[1] != 0 || d[2] != 0;
      const double near = nearOfRay ? std::max(space.near, nearOfRay[ray]) : space.near;
      double enter = near, leave = near;
      if (exists) {
        const BlockSpace::Range box = space.rangeInBox({o[0], o[1], o[2]}, {d[0], d[1], d[2]}, near);
        enter = box.near;
        leave = box.far;
      }
      if (!(enter < leave)) {
        enter = leave = near;
        if (exists && space.backgroundBlock != BackgroundBlockMode::none)
          leave = enter + 1 + std::hypot(o[0], o[1], o[2]);
      }
      range[2 * ray] = static_cast<float>(enter);
      range[2 * ray + 1] = static_cast<float>(leave);
      float* const posts = fences + ray * (a.intervals + size_t{1});
      const double offset = (jitter ? jitter[ray] : 0.5) - 0.5;
      for (uint32_t i = 1; i < a.intervals; ++i) posts[i] = static_cast<float>((i + offset) * perInterval);
      posts[0] = 0;
      posts[a.intervals] = 1;
    }
  });
}

void run(Context& context, const BlockSamples& a) {
  const size_t rays = hostCount(a.rays), tasks = (rays + kRaysPerTask - 1) / kRaysPerTask;
  const size_t maxEnds = size_t{a.maxSamples(1)} + 1;
  const Blocks blocks(a.space, a.texels);
  uint32_t* firstSample = hostPointer(a.firstSample);
  uint32_t* firstSegment = hostPointer(a.firstSegment);
  const auto forRays = [&](size_t task, const auto& visit) {
    for (size_t ray = task * kRaysPerTask; ray < std::min(rays, (task + 1) * kRaysPerTask); ++ray) visit(ray);
  };
  context.pool.run(tasks, [&](size_t task, int) {
    std::vector<Cut> cuts;
    cuts.reserve(a.maxCuts());
    forRays(task, [&](size_t ray) {
      findCuts(a, Ray(a, ray), cuts);
      firstSample[ray + 1] = a.intervals + static_cast<uint32_t>(cuts.size());  // a count, until countsToOffsets
    });
  });
  countsToOffsets(firstSample, rays, a.firstRow);
  *hostPointer(a.rowCount) = firstSample[rays];
  context.pool.run(tasks, [&](size_t task, int) {
    std::vector<Cut> cuts;
    cuts.reserve(a.maxCuts());
    std::vector<double> ends(2 * maxEnds);  // the ends of one ray's intervals in s, then in t
    Middles middles(maxEnds);
    forRays(task, [&](size_t index) {
      const Ray ray(a, index);
      findCuts(a, ray, cuts);
      double *const s = ends.data(), *const t = s + maxEnds;
      const uint32_t samples = findEnds(a, ray, cuts, s, t);
      const uint32_t segments = writeSamples(a, blocks, ray, s, t, samples, firstSample[index], middles);
      if (a.split) firstSegment[index + 1] = segments;
    });
  });
  if (!a.split) return;
  countsToOffsets(firstSegment, rays, 0);
  writeSegments(context, a, rays);
}

void run(Context& context, const BlockPoints& a) {
  const Blocks blocks(a.space, a.texels);
  const uint32_t* chosen = hostPointer(a.blocks);
  const uint32_t* slots = hostPointer(a.slotOfBlock);
  uint32_t* blockOfSample = hostPointer(a.blockOfSample);
  float* positions = hostPointer(a.positions);
  float* runtimeSteps = hostPointer(a.runtimeSteps);
  const RandomStream random(a.seed, 0x5ba);
  if (a.points > 0) CHECK(a.blocks.count > 0u);
  context.pool.forRanges(a.points, kRowsPerTask, [&](size_t begin, size_t end) {
    for (size_t p = begin; p < end; ++p) {
      const uint64_t first = 8 * uint64_t{p};
      const uint32_t block = chosen[random.below(first, static_cast<uint32_t>(a.blocks.count))];
      const Blocks::Place& place = blocks.place(block);
      blockOfSample[p] = slots ? slots[block] : block;
      Triple<double> y;
      for (int axis = 0; axis < 3; ++axis) {
        const double u = random.uniform(first + 1 + axis);
        y[axis] = place.half * (2 * u - 1);
        if (axis == 2 && !place.contracted) {
          y[axis] = a.space.bottom + u * (static_cast<double>(a.space.top) - a.space.bottom);
        }
        positions[3 * p + axis] = static_cast<float>(y[axis] * (0.5 / place.half) + 0.5);
      }
      const double z = 2.0 * random.uniform(first + 4) - 1, angle = 2 * std::numbers::pi * random.uniform(first + 5);
      const double across = std::sqrt(1 - z * z);
      double along[3] = {across * std::cos(angle), across * std::sin(angle), z};
      for (int axis = 0; axis < 3; ++axis) along[axis] *= place.inverseScale[axis];
      double speed = std::sqrt(along[0] * along[0] + along[1] * along[1] + along[2] * along[2]);
      if (place.contracted) {
        const double maximum = place.half - 1 / BlockSpace::kFarthest;
        for (double& coordinate : y) coordinate = std::clamp(coordinate, -maximum, maximum);
        const Triple<double> q = uncontract(y);
        speed = std::sqrt(Contraction(q[0], q[1], q[2]).squareSpeed(q[0], q[1], q[2], along[0], along[1], along[2]));
      }
      runtimeSteps[p] = static_cast<float>(place.texel / speed);
    }
  });
}

void run(Context& context, const GroupByBlock& a) {
  const uint32_t* blockOfSample = hostPointer(a.blockOfSample);
  uint32_t* firstOfBlock = hostPointer(a.firstOfBlock);
  uint32_t* source = hostPointer(a.source);
  const size_t samples = hostCount(a.samples), tasks = (samples + kRowsPerTask - 1) / kRowsPerTask;
  std::vector<uint32_t> places(tasks * a.blocks);  // [tasks][blocks]: counts, then the first row of each task
  context.pool.run(tasks, [&](size_t task, int) {
    uint32_t* const counts = places.data() + task * a.blocks;
    const size_t begin = task * kRowsPerTask, end = std::min(samples, begin + kRowsPerTask);
    uint32_t last = 0;
    for (size_t row = begin; row < end; ++row) last = std::max(last, blockOfSample[row]);
    CHECK(last < a.blocks);
    for (size_t row = begin; row < end; ++row) ++counts[blockOfSample[row]];
  });
  uint32_t sum = 0;
  for (uint32_t block = 0; block < a.blocks; ++block) {
    firstOfBlock[block] = sum;
    for (size_t task = 0; task < tasks; ++task) {
      const uint32_t count = places[task * a.blocks + block];
      places[task * a.blocks + block] = sum;
      sum += count;
    }
  }
  firstOfBlock[a.blocks] = sum;
  context.pool.run(tasks, [&](size_t task, int) {
    uint32_t* const next = places.data() + task * a.blocks;
    for (size_t row = task * kRowsPerTask; row < std::min(samples, (task + 1) * kRowsPerTask); ++row) {
      source[next[blockOfSample[row]]++] = static_cast<uint32_t>(row);
    }
  });
}

}  // namespace tessera::cpu

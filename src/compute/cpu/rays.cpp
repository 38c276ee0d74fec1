#include "compute/rays.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <vector>

#include "compute/cpu/kernels.h"
#include "compute/cpu/offsets.h"
#include "compute/host_memory.h"
#include "scene/lens.h"

namespace tessera::cpu {
namespace {

constexpr size_t kRaysPerTask = 64;  // fixed; the samples of all tasks are concatenated in task order

struct Sample {
  uint32_t ray;
  float position[3];
  float distance, step;
};

// The step lattice t(k), tabulated for integers; a jittered point is a constant factor (or offset) farther away.
class Lattice {
 public:
  explicit Lattice(const MarchSpace& space) : space_(space), growth_(1 + static_cast<double>(space.cone)) {
    const double last = space.stepIndex(space.far) + 3;
    if (space.cone > 0) {
      const double lambda = std::log1p(static_cast<double>(space.cone));
      linearEnd_ = 1 / lambda;
      geometricEnd_ = linearEnd_ + std::log(static_cast<double>(space.maxStep) / space.minStep) / lambda;
    } else {
      linearEnd_ = 1e30;
      geometricEnd_ = 1e30;
    }
    for (int k = 0; k <= last; ++k) {  // exact at intervals; the products in between avoid an exponential each
      const bool grows = k % 64 != 0 && k - 1 >= linearEnd_ && k <= geometricEnd_;
      table_.push_back(grows ? table_.back() * growth_ : space.distanceAt(k));
    }
  }

  // Returns t(k + jitter); factor = growth^jitter.
  double at(int k, double jitter, double factor) const {
    if (static_cast<size_t>(k) >= table_.size()) return space_.distanceAt(k + jitter);
    if (k + jitter <= linearEnd_) return (k + jitter) * space_.minStep;
    if (k >= linearEnd_ && k + jitter <= geometricEnd_) return table_[k] * factor;
    return space_.distanceAt(k + jitter);
  }
  double factor(double jitter) const { return jitter == 0 ? 1.0 : std::pow(growth_, jitter); }

 private:
  const MarchSpace& space_;
  double growth_, linearEnd_, geometricEnd_;
  std::vector<double> table_;
};

struct Cell {
  double u[3];  // grid coordinates in [0,1]
  int index[3];
  int region;   // contracted space: axis of the largest coordinate outside [-1,1]³, or -1 inside
  double sign;  // sign of that coordinate
  bool inside;  // false outside the cube of a bounded space
};

Cell cellAt(const MarchSpace& space, const double x[3]) {
  Cell cell;
  cell.region = -1;
  cell.inside = true;
  cell.sign = 1;
  const int resolution = space.gridResolution;
  if (space.contracted) {
    int axis = 0;
    for (int a = 1; a < 3; ++a) {
      if (std::abs(x[a]) > std::abs(x[axis])) axis = a;
    }
    const double m = std::abs(x[axis]);
    if (m > 1) {
      cell.region = axis;
      cell.sign = x[axis] < 0 ? -1 : 1;
      for (int a = 0; a < 3; ++a) cell.u[a] = ((a == axis ? cell.sign * (2 - 1 / m) : x[a] / m) + 2) / 4;
    } else {
      for (int a = 0; a < 3; ++a) cell.u[a] = (x[a] + 2) / 4;
    }
  } else {
    for (int a = 0; a < 3; ++a) {
      cell.u[a] = (x[a] + 1) / 2;
      cell.inside = cell.inside && cell.u[a] >= 0 && cell.u[a] < 1;
    }
  }
  for (int a = 0; a < 3; ++a) {
    cell.index[a] = std::clamp(static_cast<int>(std::floor(cell.u[a] * resolution)), 0, resolution - 1);
  }
  return cell;
}

bool occupied(const uint32_t* bits, int resolution, const Cell& cell) {
  const size_t i = cell.index[0] +
                   static_cast<size_t>(resolution) * (cell.index[1] + static_cast<size_t>(resolution) * cell.index[2]);
  return (bits[i / 32] >> (i % 32)) & 1;
}

// The distance at which the ray leaves the cell. Every face of a cell is a plane: x_a = c inside [-1,1]³; outside, in
// the region of axis a, x_a = sign · 1/(2 - y) for that axis and x_b = y · |x_a| for the others. The borders of the
// regions are |x_b| = |x_a|.
double exitDistance(const MarchSpace& space, const Cell& cell, const double o[3], const double d[3], double t) {
  const double width = (space.contracted ? 4.0 : 2.0) / space.gridResolution, origin = space.contracted ? -2.0 : -1.0;
  double exit = 1e30;
  const auto cross = [&](double value, double slope) {  // solves value + slope · t = 0 in front of t
    if (slope == 0) return;
    const double at = -value / slope;
    if (at > t) exit = std::min(exit, at);
  };
  const int region = cell.region;
  if (region < 0) {
    for (int a = 0; a < 3; ++a) {
      const double low = origin + cell.index[a] * width, high = low + width;
      cross(o[a] - low, d[a]);
      cross(o[a] - high, d[a]);
    }
    return exit;
  }
  const double om = cell.sign * o[region], dm = cell.sign * d[region];  // m along the ray
  for (int a = 0; a < 3; ++a) {
    const double low = origin + cell.index[a] * width, high = low + width;
    if (a == region) {
      for (const double y : {low, high}) {
        const double m = 2 - std::abs(y);
        if (m > 1e-12) cross(om - 1 / m, dm);
      }
    } else {
      cross(o[a] - low * om, d[a] - low * dm);
      cross(o[a] - high * om, d[a] - high * dm);
    }
  }
  return exit;
}

// Adds the next samples of the ray; returns the lattice step from which to continue.
uint32_t marchRay(const MarchRays& a, const Lattice& lattice, const uint32_t* bits, uint32_t ray,
                  std::vector<Sample>& samples) {
  const MarchSpace& space = a.space;
  const uint32_t from = a.nextStep ? hostPointer(a.nextStep)[ray] : 0;
  if (from == MarchRays::kThrough) return from;
  if (a.opticalDepth && hostPointer(a.opticalDepth)[ray] > a.maxOpticalDepth) return from;
  uint32_t left = a.maximum;
  if (left == 0) return from;
  double o[3], d[3];
  for (int axis = 0; axis < 3; ++axis) {
    o[axis] = hostPointer(a.origins)[3 * ray + axis];
    d[axis] = hostPointer(a.directions)[3 * ray + axis];
  }
  if (d[0] == 0 && d[1] == 0 && d[2] == 0) return MarchRays::kThrough;
  const double jitter = a.jitter ? hostPointer(a.jitter)[ray] : 0;
  double far = space.far, near = space.near;
  if (a.farOfRay) far = std::min<double>(far, hostPointer(a.farOfRay)[ray]);
  int k = static_cast<int>(std::ceil(space.stepIndex(near) - jitter));
  if (!space.contracted) {  // limits the ray to the cube
    double enter = 0, leave = 1e30;
    for (int axis = 0; axis < 3; ++axis) {
      const double t0 = (-1 - o[axis]) / d[axis], t1 = (1 - o[axis]) / d[axis];
      if (d[axis] == 0) {
        if (std::abs(o[axis]) > 1) return MarchRays::kThrough;
        continue;
      }
      enter = std::max(enter, std::min(t0, t1));
      leave = std::min(leave, std::max(t0, t1));
    }
    if (enter >= leave) return MarchRays::kThrough;
    far = std::min(far, leave * (1 + 1e-6) + 1e-6);
    if (enter > near) k = std::max(k, static_cast<int>(std::floor(space.stepIndex(enter) - jitter)) - 1);
  }
  k = std::max(k, static_cast<int>(std::min<uint32_t>(from, 1u << 30)));
  const double factor = lattice.factor(jitter);
  double begin = lattice.at(k, jitter, factor);
  for (;;) {
    const double end = lattice.at(k + 1, jitter, factor), middle = (begin + end) / 2;
    if (middle >= far) return MarchRays::kThrough;
    const double x[3] = {o[0] + middle * d[0], o[1] + middle * d[1], o[2] + middle * d[2]};
    const Cell cell = cellAt(space, x);
    if (cell.inside && occupied(bits, space.gridResolution, cell)) {
      Sample sample;
      sample.ray = ray;
      for (int axis = 0; axis < 3; ++axis) {
        sample.position[axis] = std::clamp(static_cast<float>(cell.u[axis]), 0.0f, 1.0f);
      }
      sample.distance = static_cast<float>(middle);
      sample.step = static_cast<float>(end - begin);
      samples.push_back(sample);
      ++k;
      if (--left == 0) return static_cast<uint32_t>(k);
      begin = end;
      continue;
    }
    ++k;
    begin = end;
    if (!cell.inside) continue;
    // Skips whole steps up to the first middle behind the empty cell; because of the tolerance, one more middle may be
    // visited.
    const double exit = exitDistance(space, cell, o, d, middle) * (1 - 1e-9);
    if (exit >= far) return MarchRays::kThrough;
    if (exit > begin + 4 * (end - middle)) {
      k = std::max(k, static_cast<int>(std::floor(space.stepIndex(exit) - jitter)) - 1);
      begin = lattice.at(k, jitter, factor);
    }
    while ((begin + lattice.at(k + 1, jitter, factor)) / 2 < exit) {
      ++k;
      begin = lattice.at(k, jitter, factor);
    }
  }
}

}  // namespace

void run(Context& context, const GenerateRays& a) {
  const RayCamera* cameras = hostPointer(a.cameras);
  const uint32_t* cameraOfRay = hostPointer(a.cameraOfRay);
  const float* pixels = hostPointer(a.pixels);
  float* origins = hostPointer(a.origins);
  float* directions = hostPointer(a.directions);
  context.pool.forRanges(hostCount(a.rays), 256, [&](size_t begin, size_t end) {
    for (size_t ray = begin; ray < end; ++ray) {
      const RayCamera& camera = cameras[cameraOfRay[ray]];
      float local[3];
      const bool ok = lensUnproject<float>(static_cast<LensModel>(camera.lens), camera.parameters, pixels[2 * ray],
                                           pixels[2 * ray + 1], local);
      float world[3] = {0, 0, 0}, square = 0;
      for (int i = 0; i < 3 && ok; ++i) {
        for (int j = 0; j < 3; ++j) world[i] += camera.rotation[3 * i + j] * local[j];
        square += world[i] * world[i];
      }
      const float scale = square > 0 ? 1 / std::sqrt(square) : 0;
      for (int i = 0; i < 3; ++i) {
        origins[3 * ray + i] = camera.centre[i];
        directions[3 * ray + i] = world[i] * scale;
      }
    }
  });
}

void run(Context& context, const MarchRays& a) {
  const uint32_t rays = hostCount(a.rays);
  const size_t tasks = (rays + kRaysPerTask - 1) / kRaysPerTask;
  const Lattice lattice(a.space);
  const uint32_t* bits = hostPointer(a.occupancy);
  uint32_t* firstSample = hostPointer(a.firstSample);
  std::vector<std::vector<Sample>> samplesOfTask(tasks);
  std::vector<uint32_t> nextStep(rays);
  context.pool.run(tasks, [&](size_t task, int) {
    std::vector<Sample>& samples = samplesOfTask[task];
    samples.reserve(kRaysPerTask * 32);
    for (size_t ray = task * kRaysPerTask; ray < std::min<size_t>(rays, (task + 1) * kRaysPerTask); ++ray) {
      const size_t before = samples.size();
      nextStep[ray] = marchRay(a, lattice, bits, static_cast<uint32_t>(ray), samples);
      firstSample[ray + 1] = static_cast<uint32_t>(samples.size() - before);  // a count, until countsToOffsets
    }
  });
  const uint32_t finished = countsToOffsets(firstSample, rays, a.sampleCapacity);
  if (a.finishedRays) *hostPointer(a.finishedRays) = finished;
  *hostPointer(a.sampleCount) = firstSample[rays];
  if (a.nextStep) std::copy(nextStep.begin(), nextStep.begin() + finished, hostPointer(a.nextStep));
  uint32_t* rayOfSample = hostPointer(a.rayOfSample);
  float* positions = hostPointer(a.positions);
  float* distances = hostPointer(a.distances);
  float* steps = hostPointer(a.steps);
  context.pool.run(tasks, [&](size_t task, int) {
    size_t i = firstSample[task * kRaysPerTask];
    const size_t end = firstSample[std::min<size_t>(rays, (task + 1) * kRaysPerTask)];
    for (size_t s = 0; i < end; ++i, ++s) {
      const Sample& sample = samplesOfTask[task][s];
      if (rayOfSample) rayOfSample[i] = sample.ray;
      std::memcpy(positions + 3 * i, sample.position, sizeof(sample.position));
      distances[i] = sample.distance;
      steps[i] = sample.step;
    }
  });
}

void run(Context& context, const OpticalDepth& a) {
  const uint32_t* firstSample = hostPointer(a.firstSample);
  const float* logDensity = hostPointer(a.logDensity.data);
  const float* steps = hostPointer(a.steps);
  float* opticalDepth = hostPointer(a.opticalDepth);
  context.pool.forRanges(hostCount(a.rays), 4 * kRaysPerTask, [&](size_t begin, size_t end) {
    for (size_t ray = begin; ray < end; ++ray) {
      for (uint32_t i = firstSample[ray]; i < firstSample[ray + 1]; ++i) {
        opticalDepth[ray] += std::exp(logDensity[a.logDensity.offset(i, 0)]) * steps[i];
      }
    }
  });
}

void run(Context& context, const CompactSamples& a) {
  const uint32_t rays = hostCount(a.rays);
  const size_t rowOfRound = size_t{a.rays.capacity} + 1;
  const uint32_t* firstSample = hostPointer(a.firstSample);
  const uint32_t* nextStep = hostPointer(a.nextStep);
  const float* logDensity = hostPointer(a.logDensity.data);
  const float* steps = hostPointer(a.steps);
  uint32_t* firstKept = hostPointer(a.keptFirstSample);
  uint32_t* source = hostPointer(a.source);
  uint32_t* rayOfSample = hostPointer(a.rayOfSample);
  // Calls visit(row) for each sample of the ray until it returns false.
  const auto forSamples = [&](size_t ray, const auto& visit) {
    for (uint32_t round = 0; round < a.rounds; ++round) {
      const uint32_t* first = firstSample + round * rowOfRound + ray;
      for (uint32_t i = first[0]; i < first[1]; ++i) {
        if (!visit(round * a.sampleCapacity + i)) return;
      }
    }
  };
  std::vector<uint8_t> complete(rays);
  context.pool.forRanges(rays, kRaysPerTask, [&](size_t begin, size_t end) {
    for (size_t ray = begin; ray < end; ++ray) {
      float opticalDepth = 0;
      uint32_t count = 0;
      forSamples(ray, [&](uint32_t row) {
        opticalDepth += std::exp(logDensity[a.logDensity.offset(row, 0)]) * steps[row];
        ++count;
        return opticalDepth <= a.maxOpticalDepth;
      });
      firstKept[ray + 1] = count;
      complete[ray] = opticalDepth > a.maxOpticalDepth || !nextStep || nextStep[ray] == MarchRays::kThrough;
    }
  });
  const auto fitting = complete.begin() + countsToOffsets(firstKept, rays, a.keptCapacity);
  const auto finished = static_cast<uint32_t>(std::find(complete.begin(), fitting, 0) - complete.begin());
  std::fill(firstKept + finished, firstKept + rays + 1, firstKept[finished]);
  if (a.finishedRays) *hostPointer(a.finishedRays) = finished;
  *hostPointer(a.keptCount) = firstKept[rays];
  context.pool.forRanges(rays, 4 * kRaysPerTask, [&](size_t begin, size_t end) {
    for (size_t ray = begin; ray < end; ++ray) {
      uint32_t i = firstKept[ray];
      const uint32_t last = firstKept[ray + 1];
      if (i == last) continue;
      forSamples(ray, [&](uint32_t row) {
        source[i] = row;
        rayOfSample[i] = static_cast<uint32_t>(ray);
        return ++i < last;
      });
    }
  });
}

}  // namespace tessera::cpu

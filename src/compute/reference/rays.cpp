#include "compute/rays.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "compute/reference/convert.h"
#include "compute/reference/functions.h"
#include "scene/contraction.h"
#include "scene/lens.h"

namespace tessera::reference {

Point contract(const Point& x) {
  return tessera::contract<double>(x);
}

Point uncontract(const Point& y) {
  return tessera::uncontract<double>(y);
}

Point gridFromScene(const MarchSpace& space, const Point& x) {
  if (!space.contracted) return {(x[0] + 1) / 2, (x[1] + 1) / 2, (x[2] + 1) / 2};
  const Point y = contract(x);
  return {(y[0] + 2) / 4, (y[1] + 2) / 4, (y[2] + 2) / 4};
}

uint32_t occupancyCellIndex(const MarchSpace& space, const Point& u) {
  const int resolution = space.gridResolution;
  uint32_t cell[3];
  for (int a = 0; a < 3; ++a) cell[a] = std::clamp(static_cast<int>(u[a] * resolution), 0, resolution - 1);
  return cell[0] + resolution * (cell[1] + resolution * cell[2]);
}

Point generateRay(const RayCamera& camera, double pixelX, double pixelY) {
  double parameters[16], inCamera[3];
  std::copy(camera.parameters, camera.parameters + 16, parameters);
  if (!lensUnproject<double>(static_cast<LensModel>(camera.lens), parameters, pixelX, pixelY, inCamera)) return {};
  Point direction{};
  for (int row = 0; row < 3; ++row)
    for (int column = 0; column < 3; ++column) direction[row] += camera.rotation[3 * row + column] * inCamera[column];
  const double length = std::hypot(direction[0], direction[1], direction[2]);
  return {direction[0] / length, direction[1] / length, direction[2] / length};
}

std::vector<MarchSample> latticeOfRay(const MarchSpace& space, const Point& origin, const Point& direction,
                                      double jitter, double far) {
  std::vector<MarchSample> samples;
  if (direction == Point{}) return samples;
  const double end = std::min(far, static_cast<double>(space.far));
  // No point of a bounded space is farther away than this.
  const double reach = std::hypot(origin[0], origin[1], origin[2]) + 2;
  const double first = std::ceil(space.stepIndex(space.near) - jitter);
  uint64_t k = static_cast<uint64_t>(std::max(0.0, first));
  for (;; ++k) {
    MarchSample sample;
    const double t = space.distanceAt(k + jitter), next = space.distanceAt(k + 1 + jitter);
    sample.step = k;
    sample.distance = (t + next) / 2;
    sample.length = next - t;
    if (sample.distance >= end || (!space.contracted && sample.distance > reach)) return samples;
    Point x;
    for (int a = 0; a < 3; ++a) x[a] = origin[a] + sample.distance * direction[a];
    sample.u = gridFromScene(space, x);
    const bool outside = std::any_of(sample.u.begin(), sample.u.end(), [](double u) { return u < 0 || u >= 1; });
    if (!space.contracted && outside) continue;
    sample.cell = occupancyCellIndex(space, sample.u);
    samples.push_back(sample);
  }
}

std::vector<MarchSample> marchRay(const MarchSpace& space, const Point& origin, const Point& direction, double jitter,
                                  double far, Indices occupancy) {
  std::vector<MarchSample> samples = latticeOfRay(space, origin, direction, jitter, far);
  std::erase_if(samples, [&](const MarchSample& s) { return (occupancy[s.cell / 32] >> s.cell % 32 & 1) == 0; });
  return samples;
}

void run(const GenerateRays& a) {
  const size_t rays = hostCount(a.rays);
  const Indices cameraOfRay = indices(a.cameraOfRay, rays);
  const Doubles pixels = doubles(a.pixels, 2 * rays);
  Doubles origins, directions;
  for (size_t r = 0; r < rays; ++r) {
    CHECK(cameraOfRay[r] < a.cameras.count);
    const RayCamera& camera = hostPointer(a.cameras)[cameraOfRay[r]];
    const Point direction = generateRay(camera, pixels[2 * r], pixels[2 * r + 1]);
    origins.insert(origins.end(), camera.centre, camera.centre + 3);
    directions.insert(directions.end(), direction.begin(), direction.end());
  }
  store(a.origins, origins);
  store(a.directions, directions);
}

void run(const MarchRays& a) {
  const size_t rays = hostCount(a.rays);
  const Doubles origins = doubles(a.origins, 3 * rays), directions = doubles(a.directions, 3 * rays);
  const Doubles jitter = doubles(a.jitter, rays), farOfRay = doubles(a.farOfRay, rays);
  const Doubles opticalDepth = doubles(a.opticalDepth, rays);
  const Indices occupancy = indices(a.occupancy, a.occupancy.count);
  uint32_t* const nextStep = hostPointer(a.nextStep);
  Doubles positions, distances, steps;
  uint32_t sampleCount = 0;
  bool full = false;
  uint32_t finished = 0;
  hostPointer(a.firstSample)[0] = 0;
  for (size_t r = 0; r < rays; ++r) {
    const Point origin = {origins[3 * r], origins[3 * r + 1], origins[3 * r + 2]};
    const Point direction = {directions[3 * r], directions[3 * r + 1], directions[3 * r + 2]};
    std::vector<MarchSample> samples;
    const bool opaque = !opticalDepth.empty() && opticalDepth[r] > a.maxOpticalDepth;
    if (!opaque)
      samples = marchRay(a.space, origin, direction, jitter.empty() ? 0 : jitter[r],
                         farOfRay.empty() ? a.space.far : farOfRay[r], occupancy);
    if (nextStep) std::erase_if(samples, [&](const MarchSample& sample) { return sample.step < nextStep[r]; });
    if (samples.size() > a.maximum) samples.resize(a.maximum);
    full = full || sampleCount + samples.size() > a.sampleCapacity;
    if (!full) {
      ++finished;
      if (nextStep && !opaque && a.maximum > 0)
        nextStep[r] =
            samples.size() == a.maximum ? static_cast<uint32_t>(samples.back().step) + 1 : MarchRays::kThrough;
      for (const MarchSample& sample : samples) {
        if (a.rayOfSample) hostPointer(a.rayOfSample)[sampleCount] = static_cast<uint32_t>(r);
        ++sampleCount;
        positions.insert(positions.end(), sample.u.begin(), sample.u.end());
        distances.push_back(sample.distance);
        steps.push_back(sample.length);
      }
    }
    hostPointer(a.firstSample)[r + 1] = sampleCount;
  }
  hostPointer(a.sampleCount)[0] = sampleCount;
  if (a.finishedRays) hostPointer(a.finishedRays)[0] = finished;
  store(a.positions, positions);
  store(a.distances, distances);
  store(a.steps, steps);
}

void run(const OpticalDepth& a) {
  const size_t rays = hostCount(a.rays);
  const Indices firstSample = indices(a.firstSample, rays + 1);
  const Doubles logDensity = doubles(a.logDensity, rays ? firstSample[rays] : 0);
  for (size_t r = 0; r < rays; ++r) {
    double sum = hostPointer(a.opticalDepth)[r];
    for (uint32_t i = firstSample[r]; i < firstSample[r + 1]; ++i)
      sum += std::exp(logDensity[i]) * hostPointer(a.steps)[i];
    hostPointer(a.opticalDepth)[r] = static_cast<float>(sum);
  }
}

void run(const CompactSamples& a) {
  const size_t rays = hostCount(a.rays);
  const Indices firstSample = indices(a.firstSample, a.rounds * (a.rays.capacity + size_t{1}));
  const Indices nextStep = indices(a.nextStep, rays);
  uint32_t keptCount = 0, finished = 0;
  bool full = false;
  hostPointer(a.keptFirstSample)[0] = 0;
  for (size_t r = 0; r < rays; ++r) {
    double opticalDepth = 0;
    std::vector<uint32_t> keptRows;
    for (uint32_t round = 0; round < a.rounds; ++round) {
      const Indices first = firstSample.subspan(round * (a.rays.capacity + size_t{1}) + r, 2);
      for (uint32_t i = first[0]; i < first[1] && opticalDepth <= a.maxOpticalDepth; ++i) {
        const uint32_t row = round * a.sampleCapacity + i;
        const double logDensity = hostPointer(a.logDensity.data)[a.logDensity.offset(row, 0)];
        opticalDepth += std::exp(logDensity) * hostPointer(a.steps)[row];
        keptRows.push_back(row);
      }
    }
    const bool through = nextStep.empty() || nextStep[r] == MarchRays::kThrough;
    full = full || keptCount + keptRows.size() > a.keptCapacity || !(opticalDepth > a.maxOpticalDepth || through);
    if (full) keptRows.clear();
    for (const uint32_t row : keptRows) {
      hostPointer(a.source)[keptCount] = row;
      hostPointer(a.rayOfSample)[keptCount++] = static_cast<uint32_t>(r);
    }
    finished += !full;
    hostPointer(a.keptFirstSample)[r + 1] = keptCount;
  }
  hostPointer(a.keptCount)[0] = keptCount;
  if (a.finishedRays) hostPointer(a.finishedRays)[0] = finished;
}

}  // namespace tessera::reference

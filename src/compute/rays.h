// Rays from pixels, and samples along rays through an occupancy grid.
#pragma once

#include "compute/memory.h"
#include "compute/operation.h"

namespace tessera {

// One photo's view as kernels see it. The pose is in scene units (the region of interest is the cube [-1,1]³).
struct RayCamera {
  int32_t lens = 1;           // LensModel
  float parameters[16] = {};  // as scene/camera.h
  float rotation[9] = {};     // sceneFromCamera, row-major
  float centre[3] = {};
};
static_assert(sizeof(RayCamera) == 4 * (1 + 16 + 9 + 3));

// Lens distortion is undone here, per ray; photos are never resampled. A pixel where the lens has no inverse gets
// direction zero: such a ray has no samples. It has no gradient: cameras are fixed.
struct GenerateRays {
  Count rays;
  Slice<const RayCamera> cameras;
  Slice<const uint32_t> cameraOfRay;  // [capacity]
  Slice<const float> pixels;          // [capacity][2]
  Slice<float> origins;               // [capacity][3]
  Slice<float> directions;            // [capacity][3], unit
};
TESSERA_OPERATION(GenerateRays);

// What lies between a ray and its samples.
//   contracted   MERF's piecewise-projective map (Reiser et al. 2023, eq. 4): identity in [-1,1]³, everything outside
//                in (-2,2)³; lines stay lines within each of the 7 regions
//   bounded      only [-1,1]³ exists
// Grid coordinates u in [0,1]³ are (contracted + 2) / 4, or (x + 1) / 2 when bounded.
//
// Steps follow instant-ngp: samples lie on the lattice t(n), n integer + the ray's jitter, with
//   dt = clamp(cone · t, minStep, maxStep)     (linear, then geometric, then linear; continuous in t)
// where λ = ln(1 + cone), t_a = minStep/λ, t_b = maxStep/λ:
//   n(t) = t / minStep                                     t ≤ t_a
//          n(t_a) + ln(t / t_a) / λ                        t_a < t ≤ t_b
//          n(t_b) + (t - t_b) / maxStep                    t > t_b
struct MarchSpace {
  bool contracted = true;
  int gridResolution = 128;  // cells per axis, a multiple of 4 and at most 512
  float near = 0.05f;
  float far = 100.0f;
  float minStep = 0.00338f;  // 2√3 / 1024
  float maxStep = 1e10f;
  float cone = 1.0f / 256;  // 0: uniform steps

  double stepIndex(double t) const;   // n(t)
  double distanceAt(double n) const;  // t(n), the inverse
};

// The intervals of a ray are [t(k + jitter), t(k + 1 + jitter)] for integers k ≥ ceil(n(near) - jitter), as long as the
// middle (the mean of both ends) is below min(far, farOfRay). Cell of a point: floor(u · resolution) per axis, clamped
// to the grid when contracted; a middle outside the cube of a bounded space has no cell. Work in double. A sample sits
// at the middle of its interval [t(n), t(n+1)]. Only samples whose middle lies in an occupied cell are made; empty
// cells are left by exact plane intersections and whole steps, so the samples are those of brute force. Rays are
// finished in order while samples fit; a ray that would pass `sampleCapacity` gets none, and so do all after it.
//
// Marching can be done in rounds, so that nobody looks behind surfaces: each run makes the next `most` samples of a
// ray, from `nextStep` on, and none of a ray whose `opticalDepth` is above `mostOpticalDepth`. Rays that do not fit in
// one round may go on in a later one.
struct MarchRays {
  static constexpr uint32_t kThrough = 0xffffffffu;  // nextStep of a ray that has no more samples

  const MarchSpace& space;
  Count rays;
  uint32_t sampleCapacity = 0;
  uint32_t most = 0xffffffffu;
  float mostOpticalDepth = 0;
  Slice<const float> origins;       // [rays][3]
  Slice<const float> directions;    // [rays][3]
  Slice<const float> jitter;        // optional, [rays], in [0,1) lattice steps; else 0
  Slice<const float> farOfRay;      // optional, [rays]: the ray ends there (opaque models)
  Slice<const uint32_t> occupancy;  // bits, cell (x,y,z) at x + R·(y + R·z), least significant first
  Slice<const float> opticalDepth;  // optional, [rays]: of the samples before
  Slice<uint32_t> nextStep;         // optional, [rays]: the first k to look at; advanced for rays that fit. A ray that
                                    // got `most` samples goes on behind the last of them, any other is kThrough
  Slice<uint32_t> firstSample;      // [rays + 1]: samples of ray r are [firstSample[r], firstSample[r+1])
  Slice<uint32_t> sampleCount;      // [1]: total made
  Slice<uint32_t> finishedRays;     // optional, [1]: rays that fit
  Slice<uint32_t> rayOfSample;      // optional, [sampleCapacity]
  Slice<float> positions;           // [sampleCapacity][3], grid coordinates in [0,1]
  Slice<float> distances;           // [sampleCapacity]: t of the middle
  Slice<float> steps;               // [sampleCapacity]: t(n+1) - t(n)
};
TESSERA_OPERATION(MarchRays);

// opticalDepth[ray] += Σ exp(logDensity) · step over the ray's samples, in order. Transmittance is exp(-opticalDepth).
struct OpticalDepth {
  Count rays;
  Slice<const uint32_t> firstSample;  // [rays + 1]
  Matrix<const float> logDensity;     // 1 column
  Slice<const float> steps;
  Slice<float> opticalDepth;  // [rays]
};
TESSERA_OPERATION(OpticalDepth);

// Keeps of each ray the samples in front of the point where its optical depth passes `mostOpticalDepth` (the one that
// crosses included), out of all rounds of marching: sample i of round q stands at row q · sampleCapacity + i. The first
// ray whose samples do not fit, or that is still transparent and not kThrough, keeps none, and so do all after it.
struct CompactSamples {
  Count rays;
  uint32_t rounds = 1;
  uint32_t sampleCapacity = 0;  // of a round
  uint32_t keptCapacity = 0;
  float mostOpticalDepth = 0;
  Slice<const uint32_t> firstSample;  // [rounds][rays.capacity + 1]
  Slice<const uint32_t> nextStep;     // optional, [rays]: as the last round left it
  Matrix<const float> logDensity;     // [rounds · sampleCapacity], 1 column
  Slice<const float> steps;           // [rounds · sampleCapacity]
  Slice<uint32_t> keptFirstSample;    // [rays + 1]
  Slice<uint32_t> keptCount;          // [1]
  Slice<uint32_t> finishedRays;       // optional, [1]: rays before that first one
  Slice<uint32_t> source;             // [keptCapacity]: the row that a kept sample was
  Slice<uint32_t> rayOfSample;        // [keptCapacity]
};
TESSERA_OPERATION(CompactSamples);

}  // namespace tessera

// Generation of rays from pixels, and sampling along rays through an occupancy grid.
#pragma once

#include "compute/memory.h"
#include "compute/operation.h"

namespace tessera {

// The camera and pose of one photo, as passed to kernels. The pose is in scene units: the region of interest is the
// cube [-1,1]³.
struct RayCamera {
  int32_t lens = 1;           // LensModel
  float parameters[16] = {};  // see scene/camera.h
  float rotation[9] = {};     // sceneFromCamera, row-major
  float centre[3] = {};
};
static_assert(sizeof(RayCamera) == 4 * (1 + 16 + 9 + 3));

// Generates the rays of pixels. Lens distortion is removed here, per ray; photos are never resampled. A pixel at which
// the lens model cannot be inverted gets direction zero, and such a ray has no samples. There is no gradient, because
// cameras are fixed.
struct GenerateRays {
  Count rays;
  Slice<const RayCamera> cameras;
  Slice<const uint32_t> cameraOfRay;  // [capacity]
  Slice<const float> pixels;          // [capacity][2]
  Slice<float> origins;               // [capacity][3]
  Slice<float> directions;            // [capacity][3], unit
};
TESSERA_OPERATION(GenerateRays);

// The space and the steps in which rays are marched.
//   contracted   the piecewise-projective contraction of MERF (Reiser et al. 2023, eq. 4): the identity in [-1,1]³, and
//                everything outside is mapped into (-2,2)³; lines stay lines within each of the 7 regions
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

  double stepIndex(double t) const;   // returns n(t)
  double distanceAt(double n) const;  // returns t(n), the inverse
};

// Samples rays where the occupancy grid is set. The intervals of a ray are [t(k + jitter), t(k + 1 + jitter)] for
// integers k ≥ ceil(n(near) - jitter), as long as the middle (the mean of both ends) is below min(far, farOfRay). The
// cell of a point is floor(u · resolution) per axis, clamped to the grid if the space is contracted; a middle outside
// the cube of a bounded space has no cell. Computed in double. A sample lies at the middle of its interval
// [t(n), t(n+1)]. Only samples whose middle lies in an occupied cell are created. Empty cells are skipped by exact
// plane intersections and whole steps, so that the samples are the same as without skipping. Rays are completed in
// order as long as their samples fit; the first ray that would exceed `sampleCapacity` gets no samples, and neither do
// the rays after it.
//
// Marching can be done in rounds, so that the space behind surfaces is not sampled: each run creates the next `maximum`
// samples of a ray, from `nextStep` on, and none for a ray whose `opticalDepth` is above `maxOpticalDepth`. Rays that
// do not fit in one round can continue in a later one.
struct MarchRays {
  static constexpr uint32_t kThrough = 0xffffffffu;  // nextStep of a ray that has no more samples

  const MarchSpace& space;
  Count rays;
  uint32_t sampleCapacity = 0;
  uint32_t maximum = 0xffffffffu;  // samples per ray in this round
  float maxOpticalDepth = 0;
  Slice<const float> origins;       // [rays][3]
  Slice<const float> directions;    // [rays][3]
  Slice<const float> jitter;        // optional, [rays], in [0,1) lattice steps; 0 if absent
  Slice<const float> farOfRay;      // optional, [rays]: the distance at which the ray ends (opaque models)
  Slice<const uint32_t> occupancy;  // bits, cell (x,y,z) at x + R·(y + R·z), least significant first
  Slice<const float> opticalDepth;  // optional, [rays]: of the samples of earlier rounds
  Slice<uint32_t> nextStep;         // optional, [rays]: the first k to visit; advanced for rays that fit. A ray with
                                    // `maximum` samples continues behind the last of them; any other gets kThrough
  Slice<uint32_t> firstSample;      // [rays + 1]: samples of ray r are [firstSample[r], firstSample[r+1])
  Slice<uint32_t> sampleCount;      // [1]: total number of samples
  Slice<uint32_t> finishedRays;     // optional, [1]: number of rays that fit
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

// Keeps the samples of each ray up to and including the one at which its optical depth exceeds `maxOpticalDepth`, out
// of all rounds of marching: sample i of round q is at row q · sampleCapacity + i. The first ray whose samples do not
// fit, or that is still transparent without being kThrough, keeps none, and neither do the rays after it.
struct CompactSamples {
  Count rays;
  uint32_t rounds = 1;
  uint32_t sampleCapacity = 0;  // per round
  uint32_t keptCapacity = 0;
  float maxOpticalDepth = 0;
  Slice<const uint32_t> firstSample;  // [rounds][rays.capacity + 1]
  Slice<const uint32_t> nextStep;     // optional, [rays]: as the last round left it
  Matrix<const float> logDensity;     // [rounds · sampleCapacity], 1 column
  Slice<const float> steps;           // [rounds · sampleCapacity]
  Slice<uint32_t> keptFirstSample;    // [rays + 1]
  Slice<uint32_t> keptCount;          // [1]
  Slice<uint32_t> finishedRays;       // optional, [1]: number of rays before that first one
  Slice<uint32_t> source;             // [keptCapacity]: the original row of a kept sample
  Slice<uint32_t> rayOfSample;        // [keptCapacity]
};
TESSERA_OPERATION(CompactSamples);

}  // namespace tessera

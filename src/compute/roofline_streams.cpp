// The roofline rows of the operations that read or write each number once. Each ray has `kLine` samples.

#include <fmt/format.h>

#include <algorithm>
#include <numeric>

#include "compute/adam.h"
#include "compute/blend.h"
#include "compute/composite.h"
#include "compute/cube_map.h"
#include "compute/encodings.h"
#include "compute/exposure.h"
#include "compute/losses.h"
#include "compute/occupancy.h"
#include "compute/rays.h"
#include "compute/roofline_recorder.h"
#include "compute/rows.h"

namespace tessera {
namespace {

constexpr uint32_t kLine = 32;

std::string describeShape(double count, const char* what) {
  return fmt::format("{:.0f} {}", count, what);
}

// Rays with kLine samples each, like the output of marching.
struct Lines {
  uint32_t rays, samples;
  Array<uint32_t> firstSample, rayOfSample;
  Array<float> logDensity, steps, distances, colours, perRay;

  Lines(RooflineRecorder& recorder, uint32_t count) : rays(count / kLine), samples(rays * kLine) {
    std::vector<uint32_t> first(rays + 1), ray(samples);
    std::vector<float> t(samples);
    for (uint32_t r = 0; r <= rays; ++r) first[r] = r * kLine;
    for (uint32_t s = 0; s < samples; ++s) {
      ray[s] = s / kLine;
      t[s] = 1 + 0.01f * static_cast<float>(s % kLine);
    }
    Device& device = recorder.device();
    firstSample = device.uploadArray(first);
    rayOfSample = device.uploadArray(ray);
    distances = device.uploadArray(t);
    steps = recorder.randomFloats(samples, 0.01f, 0.0101f);
    logDensity = recorder.randomFloats(samples, -2, 2);  // thin: no ray ends before its last sample
    colours = recorder.randomFloats(size_t{samples} * 3, 0, 1);
    perRay = recorder.randomFloats(size_t{rays} * 3, -1, 1);
  }
};

void measureEncodings(RooflineRecorder& recorder, Lines& lines) {
  Device& device = recorder.device();
  const double n = lines.samples, rays = lines.rays;
  const std::string shape = fmt::format("degree 4, {}", describeShape(n, "samples"));
  Array<float> wide = recorder.randomFloats(size_t{lines.samples} * 27, -1, 1);
  Array<float> narrow = recorder.randomFloats(size_t{lines.samples} * 3, -1, 1);
  const Matrix<float> harmonics(wide, 16), waves(wide, 27);
  recorder.measureStream(kOperation<SphericalHarmonicsForward>, shape, n * (4 + 64) + rays * 12, [&] {
    device.run(SphericalHarmonicsForward{4, {lines.samples, {}}, lines.perRay, lines.rayOfSample, harmonics});
  });
  recorder.measureStream(kOperation<SphericalHarmonicsBackward>, shape, n * (4 + 64 + 12) + rays * 12, [&] {
    device.run(SphericalHarmonicsBackward{4, {lines.samples, {}}, lines.perRay, lines.rayOfSample, harmonics, narrow});
  });
  const std::string frequencies = fmt::format("4 frequencies, {}", describeShape(n, "samples"));
  recorder.measureStream(kOperation<FrequencyForward>, frequencies, n * (12 + 108), [&] {
    device.run(FrequencyForward{3, 4, {lines.samples, {}}, lines.colours, waves});
  });
  recorder.measureStream(kOperation<FrequencyBackward>, frequencies, n * (12 + 108 + 12), [&] {
    device.run(FrequencyBackward{3, 4, {lines.samples, {}}, lines.colours, waves, narrow});
  });
}

void measureCompositing(RooflineRecorder& recorder, Lines& lines) {
  Device& device = recorder.device();
  const double n = lines.samples, rays = lines.rays;
  const std::string shape = fmt::format("{}, {} a ray", describeShape(n, "samples"), kLine);
  Array<float> colour = device.array<float>(size_t{lines.rays} * 3), opacity = device.array<float>(lines.rays);
  Array<float> depth = device.array<float>(lines.rays), weights = device.array<float>(lines.samples);
  Array<float> dx = device.array<float>(lines.samples), dColours = device.array<float>(size_t{lines.samples} * 3);

  CompositeForward forward;
  forward.rays = {lines.rays, {}};
  forward.firstSample = lines.firstSample;
  forward.x = Matrix<float>(lines.logDensity, 1);
  forward.steps = lines.steps;
  forward.distances = lines.distances;
  forward.colours = Matrix<float>(lines.colours, 3);
  forward.background = lines.perRay;
  forward.colour = colour;
  forward.opacity = opacity;
  forward.depth = depth;
  forward.weights = weights;
  recorder.measureStream(kOperation<CompositeForward>, shape, n * 28 + rays * 36, [&] { device.run(forward); });

  CompositeBackward backward;
  backward.rays = forward.rays;
  backward.firstSample = forward.firstSample;
  backward.x = forward.x;
  backward.steps = forward.steps;
  backward.distances = forward.distances;
  backward.colours = forward.colours;
  backward.background = forward.background;
  backward.rayColourGradients = lines.perRay;
  backward.xGradients = dx;
  backward.colourGradients = Matrix<float>(dColours, 3);
  recorder.measureStream(kOperation<CompositeBackward>, shape, n * (24 + 16) + rays * 28,
                         [&] { device.run(backward); });

  OpaqueForward opaque;
  opaque.offset = -4;  // no ray ends before its last sample
  opaque.rays = forward.rays;
  opaque.firstSample = lines.firstSample;
  opaque.x = forward.x;
  opaque.colours = forward.colours;
  opaque.colour = colour;
  opaque.opacity = opacity;
  recorder.measureStream(kOperation<OpaqueForward>, shape, n * 16 + rays * 20, [&] { device.run(opaque); });

  OpaqueBackward opaqueBack;
  opaqueBack.offset = opaque.offset;
  opaqueBack.rays = forward.rays;
  opaqueBack.firstSample = lines.firstSample;
  opaqueBack.x = forward.x;
  opaqueBack.colours = forward.colours;
  opaqueBack.colour = colour;
  opaqueBack.rayColourGradients = lines.perRay;
  opaqueBack.xGradients = dx;
  opaqueBack.colourGradients = Matrix<float>(dColours, 3);
  recorder.measureStream(kOperation<OpaqueBackward>, shape, n * (16 + 2 * 16) + rays * 28,
                         [&] { device.run(opaqueBack); });

  constexpr uint32_t kCells = 64;
  Array<float> grid = device.array<float>(kCells * kCells * kCells);
  OccupancySamples seen;
  seen.resolution = kCells;
  seen.offset = opaque.offset;
  seen.rays = forward.rays;
  seen.firstSample = lines.firstSample;
  seen.x = forward.x;
  seen.positions = lines.colours;  // anywhere in [0,1]³
  seen.grid = grid;
  recorder.measureStream(kOperation<OccupancySamples>, shape, n * 20 + rays * 4, [&] { device.run(seen); });

  DistortionLoss distortion;
  distortion.rays = forward.rays;
  distortion.firstSample = lines.firstSample;
  distortion.weights = weights;
  distortion.distances = lines.distances;
  distortion.steps = lines.steps;
  distortion.loss = opacity.part(0, 1);
  distortion.weightGradients = dx;
  recorder.measureStream(kOperation<DistortionLoss>, shape, n * 16 + rays * 4, [&] { device.run(distortion); });

  recorder.measureStream(kOperation<DepthLoss>, shape, n * 16 + rays * 8, [&] {
    device.run(DepthLoss{1,
                         0.01f,
                         {lines.rays, {}},
                         lines.firstSample,
                         weights,
                         lines.distances,
                         lines.distances.part(0, lines.rays),
                         opacity.part(0, 1),
                         dx});
  });
  Array<uint32_t> first = device.array<uint32_t>(lines.rays + 1), count = device.array<uint32_t>(1);
  Array<uint32_t> source = device.array<uint32_t>(lines.samples), rayOfSample = device.array<uint32_t>(lines.samples);
  recorder.measureStream(kOperation<OpticalDepth>, shape, n * 8 + rays * 12, [&] {
    device.run(
        OpticalDepth{{lines.rays, {}}, lines.firstSample, Matrix<float>(lines.logDensity, 1), lines.steps, opacity});
  });
  recorder.measureStream(kOperation<CompactSamples>, shape, n * 16 + rays * 8, [&] {
    CompactSamples compact;
    compact.rays = {lines.rays, {}};
    compact.sampleCapacity = compact.keptCapacity = lines.samples;
    compact.maxOpticalDepth = 1e6f;  // thin: no ray ends before its last sample
    compact.firstSample = lines.firstSample;
    compact.logDensity = Matrix<float>(lines.logDensity, 1);
    compact.steps = lines.steps;
    compact.keptFirstSample = first;
    compact.keptCount = count;
    compact.source = source;
    compact.rayOfSample = rayOfSample;
    device.run(compact);
  });
  Array<float> to = device.array<float>(size_t{lines.samples} * 3);
  recorder.measureStream(
      kOperation<GatherRows>, fmt::format("3 columns, {}", describeShape(n, "samples")), n * (4 + 24), [&] {
        device.run(GatherRows{{lines.samples, {}}, source, Matrix<float>(lines.colours, 3), Matrix<float>(to, 3)});
      });
}

void measureDitherLoss(RooflineRecorder& recorder, Lines& lines) {
  Device& device = recorder.device();
  const std::string shape = fmt::format("{}, {} a ray", describeShape(lines.samples, "samples"), kLine);
  Array<float> loss = device.array<float>(1), weightGradients = device.array<float>(lines.samples);
  Array<float> colourGradients = device.array<float>(size_t{lines.samples} * 3),
               rayColourGradients = device.array<float>(size_t{lines.rays} * 3);
  DitherLoss dither;
  dither.rays = {lines.rays, {}};
  dither.firstSample = lines.firstSample;
  dither.weights = lines.steps;
  dither.colours = Matrix<float>(lines.colours, 3);
  dither.colour = lines.perRay;
  dither.loss = loss;
  dither.weightGradients = weightGradients;
  dither.colourGradients = Matrix<float>(colourGradients, 3);
  dither.rayColourGradients = rayColourGradients;
  recorder.measureStream(kOperation<DitherLoss>, shape, lines.samples * 44.0 + lines.rays * 40.0,
                         [&] { device.run(dither); });
}

// Measures blending with two segments per ray.
void measureBlending(RooflineRecorder& recorder, uint32_t segments) {
  Device& device = recorder.device();
  const uint32_t rays = segments / 2;
  segments = 2 * rays;
  std::vector<uint32_t> first(rays + 1);
  for (uint32_t r = 0; r <= rays; ++r) first[r] = 2 * r;
  Array<uint32_t> firstSegment = device.uploadArray(first);
  Array<float> composited = recorder.randomFloats(size_t{segments} * 7, 0, 1),
               colour = device.array<float>(size_t{rays} * 3);
  Array<float> specular = recorder.randomFloats(size_t{segments} * 3, 0, 1), opacity = device.array<float>(rays);
  Array<float> alpha = recorder.randomFloats(segments, 0.1f, 0.9f), depth = device.array<float>(rays);
  Array<float> dComposited = device.array<float>(composited.size()), dSpecular = device.array<float>(specular.size());
  Array<float> dAlpha = device.array<float>(segments), loss = device.array<float>(1);
  const std::string shape = fmt::format("{}, 2 a ray", describeShape(segments, "segments"));
  recorder.measureStream(kOperation<BlendForward>, shape, segments * 48.0 + rays * 24.0, [&] {
    device.run(
        BlendForward{false, {rays, {}}, firstSegment, composited, specular, alpha, alpha, colour, opacity, depth});
  });
  recorder.measureStream(kOperation<BlendBackward>, shape, segments * 88.0 + rays * 16.0, [&] {
    device.run(BlendBackward{
        false, {rays, {}}, firstSegment, composited, specular, alpha, colour, {}, dComposited, dSpecular, dAlpha});
  });
  recorder.measureStream(kOperation<OpacityLoss>, describeShape(segments, "segments"), segments * 12.0, [&] {
    device.run(OpacityLoss{1, {segments, {}}, alpha, loss, dAlpha});
  });
}

// Occupancy of a spherical shell with a radius of 0.18 to 0.2 of the width of the grid.
std::vector<uint32_t> shellOccupancy(const MarchSpace& space) {
  const int size = space.gridResolution;
  std::vector<uint32_t> bits(static_cast<size_t>(size) * size * size / 32);
  for (int z = 0; z < size; ++z) {
    for (int y = 0; y < size; ++y) {
      for (int x = 0; x < size; ++x) {
        const auto centred = [&](int i) { return (i + 0.5f) / size - 0.5f; };
        const float r2 = centred(x) * centred(x) + centred(y) * centred(y) + centred(z) * centred(z);
        const size_t cell = x + static_cast<size_t>(size) * (y + static_cast<size_t>(size) * z);
        if (r2 > 0.18f * 0.18f && r2 < 0.2f * 0.2f) bits[cell / 32] |= 1u << cell % 32;
      }
    }
  }
  return bits;
}

void measureRays(RooflineRecorder& recorder, uint32_t capacity) {
  Device& device = recorder.device();
  const uint32_t rays = capacity / kLine;
  std::vector<RayCamera> cameras(1);
  cameras[0].parameters[0] = cameras[0].parameters[1] = 500;
  cameras[0].parameters[2] = cameras[0].parameters[3] = 256;
  for (const int i : {0, 4, 8}) cameras[0].rotation[i] = 1;
  Array<RayCamera> camera = device.uploadArray(cameras);
  Array<uint32_t> cameraOfRay = device.array<uint32_t>(rays);
  Array<float> pixels = recorder.randomFloats(size_t{rays} * 2, 0, 512);
  Array<float> origins = device.array<float>(size_t{rays} * 3), directions = device.array<float>(size_t{rays} * 3);
  recorder.measureStream(kOperation<GenerateRays>, describeShape(rays, "rays"), rays * 36.0, [&] {
    device.run(GenerateRays{{rays, {}}, camera, cameraOfRay, pixels, origins, directions});
  });

  const MarchSpace space;
  Array<uint32_t> occupancy = device.uploadArray(shellOccupancy(space));
  Array<uint32_t> first = device.array<uint32_t>(rays + 1), counters = device.array<uint32_t>(2);
  Array<uint32_t> rayOfSample = device.array<uint32_t>(capacity);
  Array<float> positions = device.array<float>(size_t{capacity} * 3), distances = device.array<float>(capacity);
  Array<float> steps = device.array<float>(capacity), jitter = recorder.randomFloats(rays, 0, 1);
  MarchRays march{space};
  march.rays = {rays, {}};
  march.sampleCapacity = capacity;
  march.origins = origins;
  march.directions = directions;
  march.jitter = jitter;
  march.occupancy = occupancy;
  march.firstSample = first;
  march.sampleCount = counters.part(0, 1);
  march.finishedRays = counters.part(1, 1);
  march.rayOfSample = rayOfSample;
  march.positions = positions;
  march.distances = distances;
  march.steps = steps;
  device.run(march);
  const uint32_t sampleCount = device.read(counters.all())[0];
  recorder.measureStream(kOperation<MarchRays>, fmt::format("{} rays, {} samples", rays, sampleCount),
                         sampleCount * 24.0 + rays * 32.0, [&] { device.run(march); });
  Array<uint32_t> nextStep = device.array<uint32_t>(rays);
  Array<float> opticalDepth = device.array<float>(rays);
  march.maximum = 8;
  march.nextStep = nextStep;
  march.opticalDepth = opticalDepth;
  device.run(march);
  const uint32_t round = device.read(counters.all())[0];
  recorder.measureStream(kOperation<MarchRays>, fmt::format("{} rays, the first {} samples", rays, round),
                         round * 24.0 + rays * 44.0, [&] {
                           device.fillZero(nextStep.all());
                           device.run(march);
                         });
}

// The map is small, so that only what rays read and write counts.
void measureCubeMap(RooflineRecorder& recorder, uint32_t rays) {
  Device& device = recorder.device();
  constexpr uint32_t kResolution = 64;
  const size_t numbers = size_t{18} * kResolution * kResolution;
  Array<float> texels = recorder.randomFloats(numbers, 0, 1), texelGradients = device.array<float>(numbers);
  Array<float> directions = recorder.randomFloats(size_t{rays} * 3, -1, 1),
               colours = recorder.randomFloats(size_t{rays} * 3, -1, 1);
  Array<float> opacity = recorder.randomFloats(rays, 0, 1);
  const std::string shape = fmt::format("resolution {}, {}", kResolution, describeShape(rays, "rays"));
  CubeMapBackward backward;
  backward.resolution = kResolution;
  backward.rays = {rays, {}};
  backward.directions = directions;
  backward.opacity = opacity;
  backward.rayColourGradients = colours;
  backward.texelGradients = texelGradients;
  recorder.measureStream(kOperation<CubeMapBackward>, shape, rays * 28.0, [&] { device.run(backward); });

  CubeMapForward forward;
  forward.resolution = kResolution;
  forward.rays = backward.rays;
  forward.directions = directions;
  forward.texels = texels;
  forward.colours = colours;
  recorder.measureStream(kOperation<CubeMapForward>, shape, rays * 24.0, [&] { device.run(forward); });
}

void measureLosses(RooflineRecorder& recorder, uint32_t rays) {
  Device& device = recorder.device();
  const std::string shape = describeShape(rays, "rays");
  Array<float> predicted = recorder.randomFloats(size_t{rays} * 3, 0, 1),
               target = recorder.randomFloats(size_t{rays} * 3, 0, 1);
  Array<float> weights = recorder.randomFloats(rays, 1, 1), loss = device.array<float>(2);
  Array<float> out = device.array<float>(size_t{rays} * 3), gains = device.array<float>(300),
               gainGradients = device.array<float>(300);
  std::vector<uint32_t> photos(rays);
  for (uint32_t r = 0; r < rays; ++r) photos[r] = r % 100;
  Array<uint32_t> photoOfRay = device.uploadArray(photos);
  recorder.measureStream(kOperation<ColourLoss>, shape, rays * 40.0, [&] {
    device.run(ColourLoss{ColourLossKind::huber, 0.1f, 1, {rays, {}}, predicted, target, weights, loss, out});
  });
  // The number of rays of a training step, since each patch accesses all of them in random order.
  const uint32_t batch = std::min(rays, 16384u);
  recorder.measureStream(kOperation<S3imLoss>, fmt::format("{} rays, 10 patches", batch), batch * 52.0, [&] {
    device.run(S3imLoss{1, {batch, {}}, 10, 1, predicted, target, weights, loss.part(0, 1), out});
  });
  recorder.measureStream(kOperation<SparsityLoss>, describeShape(rays, "points"), rays * 12.0, [&] {
    device.run(SparsityLoss{1, {rays, {}}, predicted.part(0, rays), target.part(0, rays), loss.part(0, 1), out});
  });
  recorder.measureStream(kOperation<ExposureForward>, shape, rays * 28.0, [&] {
    device.run(ExposureForward{{rays, {}}, predicted, {}, {}, photoOfRay, gains, out});
  });
  recorder.measureStream(kOperation<ExposureBackward>, shape, rays * 40.0, [&] {
    device.run(ExposureBackward{{rays, {}}, predicted, {}, photoOfRay, gains, target, out, {}, gainGradients});
  });
}

void measureOccupancy(RooflineRecorder& recorder) {
  Device& device = recorder.device();
  const MarchSpace space;
  const uint32_t cells = static_cast<uint32_t>(space.gridResolution) * space.gridResolution * space.gridResolution;
  const uint32_t half = cells / 8, points = 2 * half;
  Array<uint32_t> occupancy = device.uploadArray(shellOccupancy(space)), chosen = device.array<uint32_t>(points);
  Array<float> positions = device.array<float>(size_t{points} * 3), grid = recorder.randomFloats(cells, 0, 0.02f);
  Array<float> logDensity = recorder.randomFloats(points, -2, 2);
  recorder.measureStream(kOperation<OccupancyPoints>, describeShape(points, "points"), points * 16.0, [&] {
    device.run(OccupancyPoints{space, half, half, 1, {}, occupancy, chosen, positions});
  });
  recorder.measureStream(
      kOperation<OccupancyUpdate>, fmt::format("{} cells, {} points", cells, points), cells * 8.125 + points * 8.0,
      [&] {
        device.run(OccupancyUpdate{space, points, 0.95f, 0.01f, chosen, Matrix<float>(logDensity, 1), grid, occupancy});
      });
}

void measureAdam(RooflineRecorder& recorder, size_t n) {
  Device& device = recorder.device();
  Array<float> values = recorder.randomFloats(n, -1, 1), gradients = recorder.randomFloats(n, -1, 1);
  Array<float> first = recorder.randomFloats(n, -1, 1), second = recorder.randomFloats(n, 0.5f, 1);
  Array<uint32_t> counts = device.array<uint32_t>(n);
  Adam adam;
  adam.rate = 1e-6f;
  adam.l2 = 1e-3f;  // keeps the moments from becoming denormal, as gradients are zero after the first run
  adam.parameters = values;
  adam.gradients = gradients;
  adam.firstMoments = first;
  adam.secondMoments = second;
  adam.counts = counts;
  recorder.measureStream(kOperation<Adam>, fmt::format("all of {} parameters", n), n * 40.0, [&] { device.run(adam); });
  adam.skipZeroGradients = true;
  adam.l2 = 0;
  recorder.measureStream(kOperation<Adam>, fmt::format("none of {}: zero gradients", n), n * 4.0,
                         [&] { device.run(adam); });
}

}  // namespace

void measureSampleStreams(RooflineRecorder& recorder) {
  Lines lines(recorder, recorder.options().streamed);
  measureEncodings(recorder, lines);
  measureCompositing(recorder, lines);
  measureDitherLoss(recorder, lines);
  measureBlending(recorder, recorder.options().streamed / 8);
  measureRays(recorder, recorder.options().streamed);
  measureCubeMap(recorder, recorder.options().streamed);
}

void measureParameterStreams(RooflineRecorder& recorder) {
  measureLosses(recorder, recorder.options().streamed);
  measureOccupancy(recorder);
  measureAdam(recorder, size_t{recorder.options().streamed} * 4);
}

}  // namespace tessera

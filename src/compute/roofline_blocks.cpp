// The roofline rows of sampling through blocks: a grid of 3 × 2 blocks seen from above.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "compute/blocks.h"
#include "compute/proposals.h"
#include "compute/roofline_recorder.h"
#include "compute/rows.h"

namespace tessera {
namespace {

constexpr uint32_t kIntervals = 64;

// Rays that look down on the grid from all directions.
struct Rays {
  uint32_t count;
  Array<float> origins, directions;

  Rays(RooflineRecorder& recorder, uint32_t rays) : count(rays) {
    Device& device = recorder.device();
    origins = recorder.randomFloats(size_t{rays} * 3, -2.5f, 2.5f);
    directions = recorder.randomFloats(size_t{rays} * 3, -0.5f, 0.5f);
    std::vector<float> from = device.read(origins.all()), along = device.read(directions.all());
    for (uint32_t r = 0; r < rays; ++r) {
      from[3 * r + 2] = 2;
      const float x = along[3 * r], y = along[3 * r + 1];
      along[3 * r + 2] = -std::sqrt(1 - x * x - y * y);
    }
    device.write(origins.all(), std::span<const float>(from));
    device.write(directions.all(), std::span<const float>(along));
  }
};

// The outputs of BlockSamples.
struct Samples {
  Array<uint32_t> firstSample, counters, blocks, firstSegment, firstOfSegment, groupOfSegment, rayOfSegment;
  Array<float> positions, distances, steps, middles, widths, runtimeSteps;

  Samples(Device& device, const BlockSamples& a, uint32_t rays)
      : firstSample(device.array<uint32_t>(rays + 1)),
        counters(device.array<uint32_t>(2)),
        blocks(device.array<uint32_t>(a.maxSamples(rays))),
        firstSegment(device.array<uint32_t>(rays + 1)),
        firstOfSegment(device.array<uint32_t>(a.maxSegments(rays) + 1)),
        groupOfSegment(device.array<uint32_t>(a.maxSegments(rays))),
        rayOfSegment(device.array<uint32_t>(a.maxSegments(rays))),
        positions(device.array<float>(size_t{a.maxSamples(rays)} * 3)),
        distances(device.array<float>(a.maxSamples(rays))),
        steps(device.array<float>(a.maxSamples(rays))),
        middles(device.array<float>(a.maxSamples(rays))),
        widths(device.array<float>(a.maxSamples(rays))),
        runtimeSteps(device.array<float>(a.maxSamples(rays))) {}

  void nameIn(BlockSamples& a) {
    a.firstSample = firstSample;
    a.rowCount = counters.part(0, 1);
    a.blockOfSample = blocks;
    a.positions = positions;
    a.distances = distances;
    a.steps = steps;
    a.middles = middles;
    a.widths = widths;
    if (!a.split) return;
    a.runtimeSteps = runtimeSteps;
    a.texels = 2048;
    a.firstSegment = firstSegment;
    a.segmentCount = counters.part(1, 1);
    a.firstSampleOfSegment = firstOfSegment;
    a.groupOfSegment = groupOfSegment;
    a.rayOfSegment = rayOfSegment;
  }
};

void measureMoves(RooflineRecorder& recorder, const BlockSpace& space, Samples& samples, uint32_t rows) {
  Device& device = recorder.device();
  const std::string shape = fmt::format("{} samples, {} blocks", rows, space.blocks());
  Array<uint32_t> firstOfBlock = device.array<uint32_t>(space.blocks() + 1), source = device.array<uint32_t>(rows);
  recorder.measureStream(kOperation<GroupByBlock>, shape, rows * 8.0, [&] {
    device.run(GroupByBlock{{rows}, space.blocks(), samples.blocks, firstOfBlock, source});
  });
  Array<float> to = device.array<float>(size_t{rows} * 3);
  recorder.measureStream(kOperation<ScatterRows>, "3 columns, " + shape, rows * (4.0 + 24), [&] {
    device.run(ScatterRows{{rows}, source, Matrix<float>(samples.positions, 3), Matrix<float>(to, 3)});
  });
}

void measureProposals(RooflineRecorder& recorder, const Slice<const float>& fences, const BlockSamples& sampled,
                      uint32_t rays, uint32_t rows) {
  Device& device = recorder.device();
  const double bins = static_cast<double>(rays) * kIntervals;
  Array<float> weights = recorder.randomFloats(size_t{rays} * kIntervals, 0, 0.01f);
  Array<float> gradients = device.array<float>(size_t{rays} * kIntervals), loss = device.array<float>(1);
  Array<float> resampled = device.array<float>(size_t{rays} * (kIntervals + 1));
  ResampleFences resample{{rays}, kIntervals, kIntervals, 1, 0.01f, fences, weights, {}, resampled};
  const std::string shape = fmt::format("{} rays, {} from {} intervals", rays, kIntervals, kIntervals);
  recorder.measureStream(kOperation<ResampleFences>, shape, bins * 12, [&] { device.run(resample); });
  resample.anneal = 0.5f;
  recorder.measureStream(kOperation<ResampleFences>, shape + ", annealed", bins * 12, [&] { device.run(resample); });
  Array<float> sampleWeights = recorder.randomFloats(rows, 0, 0.02f);
  InterlevelLoss interlevel;
  interlevel.rays = {rays};
  interlevel.intervals = kIntervals;
  interlevel.fences = fences;
  interlevel.weights = weights;
  interlevel.firstSample = sampled.firstSample;
  interlevel.middles = sampled.middles;
  interlevel.widths = sampled.widths;
  interlevel.sampleWeights = sampleWeights;
  interlevel.loss = loss;
  interlevel.weightGradients = gradients;
  recorder.measureStream(kOperation<InterlevelLoss>, fmt::format("{} rays, {} samples", rays, rows),
                         bins * 12 + rows * 12.0, [&] { device.run(interlevel); });
}

}  // namespace

void measureBlockStreams(RooflineRecorder& recorder) {
  Device& device = recorder.device();
  const uint32_t rays = std::max(1u, recorder.options().streamed / kIntervals);
  const BlockSpace space{.columns = 3, .rows = 2};
  Rays views(recorder, rays);
  Array<float> range = device.array<float>(size_t{rays} * 2);
  Array<float> fences = device.array<float>(size_t{rays} * (kIntervals + 1));
  const std::string shape = fmt::format("{} rays, {} intervals", rays, kIntervals);
  const double perRay = 24 + 8 + 4 * (kIntervals + 1);
  const EnterScene enter{space, {rays}, kIntervals, views.origins, views.directions, {}, {}, range, fences};
  recorder.measureStream(kOperation<EnterScene>, shape, rays * perRay, [&] { device.run(enter); });

  for (const bool split : {false, true}) {
    BlockSamples sample{space};
    sample.rays = {rays};
    sample.intervals = kIntervals;
    sample.split = split;
    sample.origins = views.origins;
    sample.directions = views.directions;
    sample.range = range;
    sample.fences = fences;
    Samples samples(device, sample, rays);
    samples.nameIn(sample);
    device.run(sample);
    const uint32_t rows = device.read(sample.rowCount)[0];
    recorder.measureStream(kOperation<BlockSamples>, shape + (split ? ", split" : ""),
                           rays * perRay + rows * (split ? 36.0 : 32.0), [&] { device.run(sample); });
    if (split) continue;
    measureMoves(recorder, space, samples, rows);
    measureProposals(recorder, fences.all(), sample, rays, rows);
  }
  const uint32_t points = recorder.options().streamed;
  Array<uint32_t> chosen = device.uploadArray(std::vector<uint32_t>{0, 3, 6}), blocks = device.array<uint32_t>(points);
  Array<float> positions = device.array<float>(size_t{points} * 3), steps = device.array<float>(points);
  recorder.measureStream(kOperation<BlockPoints>, fmt::format("{} points", points), points * 20.0, [&] {
    device.run(BlockPoints{space, points, 1, 2048, chosen, {}, blocks, positions, steps});
  });
}

}  // namespace tessera

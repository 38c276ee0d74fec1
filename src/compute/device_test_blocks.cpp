// Test cases of sampling through blocks.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "compute/device_test.h"
#include "compute/rows.h"
#include "compute/testing/test_block_rays.h"

namespace tessera::device_test {
namespace {

// Fences that are uniform from 0 to 1, or random with some of them equal, as from resampling.
std::vector<float> makeFences(Random& random, size_t rays, uint32_t intervals, bool even) {
  std::vector<float> fences;
  for (size_t r = 0; r < rays; ++r) {
    std::vector<float> ofRay = random.floats(intervals + 1, 0, 1);
    std::sort(ofRay.begin(), ofRay.end());
    if (intervals > 4) ofRay[3] = ofRay[2];
    if (even) ofRay = toFloats(reference::firstFences(intervals, random.uniform(0, 1)));
    fences.insert(fences.end(), ofRay.begin(), ofRay.end());
  }
  return fences;
}

// Distances range from nearly 0 to 1e6, so their logarithms are compared as well to detect errors in small ones.
void watchLogarithms(Stage& stage, const std::string& name, const Slice<float>& values) {
  std::vector<float> logarithms = stage.device.read(values);
  for (float& value : logarithms)
    if (value != kPoison) value = value > 0 ? std::log(value) : -100;
  stage.output(name, logarithms, 1e-6);
}

struct SampleOptions {
  bool split = false, everything = false;
};

void runBlockSamples(Stage& stage, const BlockSpace& space, const Size& size, const SampleOptions& options) {
  const uint32_t rays = size.capacity, intervals = options.everything ? 24 : 7;
  const BlockRays views(stage.random, space, rays);
  std::vector<float> range;
  for (size_t r = 0; r < rays; ++r)
    for (double end : reference::rangeInScene(space, views.origin(r), views.direction(r)))
      range.push_back(static_cast<float>(end));
  BlockSamples a{space};
  a.rays = stage.count(size);
  a.intervals = intervals;
  a.split = options.split;
  a.firstRow = options.everything ? 11 : 0;
  a.origins = stage.input(views.origins);
  a.directions = stage.input(views.directions);
  a.range = stage.input(range);
  if (options.everything) a.farOfRay = stage.randomInput(rays, 0, 8);
  a.fences = stage.input(makeFences(stage.random, rays, intervals, !options.everything));
  const uint32_t rows = a.firstRow + a.maxSamples(rays);
  a.firstSample = stage.outputWords("firstSample", rays + 1);
  a.rowCount = stage.outputWords("rowCount", 1);
  a.blockOfSample = stage.outputWords("blockOfSample", rows);
  a.positions = stage.output("positions", 3 * rows, 1e-6);
  a.distances = stage.output("distances", rows, 1e-6);
  a.steps = stage.output("steps", rows, 1e-6);
  if (options.everything) {
    a.middles = stage.output("middles", rows, 1e-6);
    a.widths = stage.output("widths", rows, 1e-6);
    a.runtimeSteps = stage.output("runtimeSteps", rows, 1e-6);
    a.texels = 64;
    // Every third block has no slot; the others are assigned slots from the last one on.
    std::vector<uint32_t> slots(space.blocks(), kNoSlot);
    for (uint32_t block = 0; block < space.blocks(); ++block)
      if (block % 3 != 1) slots[block] = space.blocks() - 1 - block;
    a.slotOfBlock = stage.input(slots);
  }
  if (options.split) {
    if (options.everything) {
      std::vector<uint32_t> groups(space.blocks());
      for (uint32_t block = 0; block < space.blocks(); ++block) groups[block] = block / 2;
      a.groupOfBlock = stage.input(groups);
    }
    a.firstSegment = stage.outputWords("firstSegment", rays + 1);
    a.segmentCount = stage.outputWords("segmentCount", 1);
    a.firstSampleOfSegment = stage.outputWords("firstSampleOfSegment", a.maxSegments(rays) + 1);
    a.groupOfSegment = stage.outputWords("groupOfSegment", a.maxSegments(rays));
    a.rayOfSegment = stage.outputWords("rayOfSegment", a.maxSegments(rays));
  }
  stage.device.run(a);
  watchLogarithms(stage, "log of distances", a.distances);
  if (options.everything) watchLogarithms(stage, "log of runtimeSteps", a.runtimeSteps);
}

}  // namespace

template <>
OperationTests makeTests<EnterScene>() {
  OperationTests tests;
  tests.noGradient = "cameras and fence posts are fixed";
  for (const NamedBlockSpace& named : blockSpaces())
    for (const Size& size : kSizes)
      for (bool jittered : {false, true})
        tests.cases.push_back(
            {fmt::format("{}, rays {}{}", named.name, toString(size), jittered ? ", jitter, near" : ""),
             [=](Stage& stage) {
               const uint32_t intervals = jittered ? 17 : 1;
               const BlockRays views(stage.random, named.space, size.capacity);
               EnterScene a{named.space};
               a.rays = stage.count(size);
               a.intervals = intervals;
               a.origins = stage.input(views.origins);
               a.directions = stage.input(views.directions);
               if (jittered) a.jitter = stage.randomInput(size.capacity, 0, 1);
               if (jittered) a.nearOfRay = stage.randomInput(size.capacity, 0, 4);
               a.range = stage.output("range", 2 * size.capacity, 1e-6);
               a.fences = stage.output("fences", (intervals + 1) * size.capacity, 1e-6);
               stage.device.run(a);
             }});
  return tests;
}

template <>
OperationTests makeTests<BlockSamples>() {
  OperationTests tests;
  tests.decides = true;
  tests.noGradient = "cameras and fence posts are fixed";
  for (const NamedBlockSpace& named : blockSpaces())
    for (const Size& size : kSizes)
      for (bool split : {false, true})
        for (bool everything : {false, true})
          tests.cases.push_back({fmt::format("{}, rays {}{}{}", named.name, toString(size), split ? ", split" : "",
                                             everything ? ", all optional arguments" : ""),
                                 [=](Stage& stage) {
                                   runBlockSamples(stage, named.space, size, {split, everything});
                                 }});
  return tests;
}

template <>
OperationTests makeTests<BlockPoints>() {
  OperationTests tests;
  tests.noGradient = "it only chooses where to look";
  for (const NamedBlockSpace& named : blockSpaces())
    for (uint32_t points : {0u, 1u, 1061u, 9001u})
      tests.cases.push_back({fmt::format("{}, {} points", named.name, points), [=](Stage& stage) {
                               std::vector<uint32_t> blocks(named.space.blocks());
                               std::iota(blocks.begin(), blocks.end(), 0u);
                               if (points == 1061) blocks = {blocks.back(), 0};
                               BlockPoints a{named.space};
                               a.points = points;
                               a.seed = stage.random.bits();
                               a.texels = 64;
                               a.blocks = stage.input(blocks);
                               std::reverse(blocks.begin(), blocks.end());
                               if (points == 9001) a.slotOfBlock = stage.input(blocks);
                               a.blockOfSample = stage.outputWords("blockOfSample", points);
                               a.positions = stage.output("positions", 3 * size_t{points}, 1e-6);
                               a.runtimeSteps = stage.output("runtimeSteps", points, 1e-6);
                               stage.device.run(a);
                               watchLogarithms(stage, "log of runtimeSteps", a.runtimeSteps);
                             }});
  return tests;
}

template <>
OperationTests makeTests<GroupByBlock>() {
  OperationTests tests;
  tests.noGradient = "it only says what goes where";
  std::vector<Size> sizes(std::begin(kSizes), std::end(kSizes));
  sizes.push_back({20011, 17003});  // many tasks
  for (uint32_t blocks : {1u, 7u, 300u})
    for (const Size& size : sizes)
      tests.cases.push_back({fmt::format("{} blocks, samples {}", blocks, toString(size)), [=](Stage& stage) {
                               GroupByBlock a;
                               a.samples = stage.count(size);
                               a.blocks = blocks;
                               a.blockOfSample = stage.input(stage.random.wordsBelow(size.capacity, blocks));
                               a.firstOfBlock = stage.outputWords("firstOfBlock", blocks + 1);
                               a.source = stage.outputWords("source", size.capacity);
                               stage.device.run(a);
                             }});
  return tests;
}

template <>
OperationTests makeTests<ScatterRows>() {
  OperationTests tests;
  tests.noGradient = "it moves what has been computed";
  struct Shape {
    uint32_t columns;
    Layout layout;
  };
  std::vector<Size> sizes(std::begin(kSizes), std::end(kSizes));
  sizes.push_back({9001, 8500});  // many tasks
  for (const Shape& shape :
       {Shape{1, Layout::plain}, Shape{3, Layout::plain}, Shape{16, Layout::strided}, Shape{8, Layout::grouped}})
    for (const Size& size : sizes)
      tests.cases.push_back({fmt::format("{} columns, rows {}", shape.columns, toString(size)), [=](Stage& stage) {
                               std::vector<uint32_t> source(size.capacity);
                               std::iota(source.begin(), source.end(), 0u);
                               for (uint32_t i = size.capacity; i > 1; --i)
                                 std::swap(source[i - 1], source[stage.random.below(i)]);
                               Matrix<float> input =
                                   stage.randomMatrix(size.capacity, shape.columns, shape.layout, -1, 1);
                               // Arbitrary bits, because integers are moved too and can look like NaN or denormals.
                               std::vector<uint32_t> bits(input.data.count);
                               for (uint32_t& word : bits) word = stage.random.bits() >> stage.random.below(32);
                               if (input)
                                 stage.device.writeBytes(*input.data.memory, input.data.first * sizeof(float),
                                                         std::as_bytes(std::span(bits)));
                               ScatterRows a;
                               a.rows = stage.count(size);
                               a.source = stage.input(source);
                               a.input = input;
                               a.output = stage.outputMatrix("output", size.capacity, shape.columns, shape.layout, 0);
                               stage.device.run(a);
                             }});
  return tests;
}

}  // namespace tessera::device_test

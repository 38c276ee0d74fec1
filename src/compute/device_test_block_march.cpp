// Test cases of marching through blocks.
#include <fmt/format.h>

#include "compute/block_march.h"
#include "compute/device_test.h"
#include "compute/testing/test_block_rays.h"

namespace tessera::device_test {
namespace {

constexpr uint32_t kCells = 8;

// The occupancy of all slots, each bit set with probability `share`.
std::vector<uint32_t> randomOccupancy(Random& random, uint32_t slots, float share) {
  std::vector<uint32_t> bits(slots * kCells * kCells * kCells / 32);
  for (uint32_t& word : bits) {
    for (uint32_t bit = 0; bit < 32; ++bit) word |= (random.uniform(0, 1) < share ? 1u : 0u) << bit;
  }
  return bits;
}

void watchSamples(Stage& stage, uint32_t rays, uint32_t capacity, MarchBlocks& a) {
  a.sampleCapacity = capacity;
  a.firstSample = stage.outputWords("firstSample", rays + 1);
  a.sampleCount = stage.outputWords("sampleCount", 1);
  a.finishedRays = stage.outputWords("finishedRays", 1);
  a.rayOfSample = stage.outputWords("rayOfSample", capacity);
  a.slotOfSample = stage.outputWords("slotOfSample", capacity);
  a.positions = stage.output("positions", size_t{3} * capacity, 1e-6);
  a.distances = stage.output("distances", capacity, 1e-6);
  a.steps = stage.output("steps", capacity, 1e-6);
  a.middles = stage.output("middles", capacity, 1e-6);
  a.widths = stage.output("widths", capacity, 1e-6);
}

}  // namespace

template <>
OperationTests makeTests<MarchBlocks>() {
  OperationTests tests;
  tests.decides = true;
  tests.noGradient = "sample positions carry no gradient";
  for (const NamedBlockSpace& named : blockSpaces())
    for (const Size& size : {Size{0}, Size{1}, Size{37}, Size{40, 23}, Size{5, 0}, Size{150, 1000}})
      for (float share : {0.0f, 0.05f, 0.5f, 1.0f})
        for (bool optional : {false, true}) {
          if (share == 1 && size.used() > 40) continue;
          tests.cases.push_back({fmt::format("{}, rays {}, {} occupied{}", named.name, toString(size), share,
                                             optional ? ", jitter, near, far, slots, few samples" : ""),
                                 [=](Stage& stage) {
                                   const BlockSpace& space = named.space;
                                   const BlockRays rays(stage.random, space, size.capacity);
                                   MarchBlocks a{space};
                                   a.cells = kCells;
                                   a.step = 0.055f;
                                   a.rays = stage.count(size);
                                   a.origins = stage.input(rays.origins);
                                   a.directions = stage.input(rays.directions);
                                   uint32_t slots = space.blocks();
                                   if (optional) {
                                     a.jitter = stage.randomInput(size.capacity, 0, 1);
                                     a.nearOfRay = stage.randomInput(size.capacity, 0, 1);
                                     a.farOfRay = stage.randomInput(size.capacity, 0, 8);
                                     std::vector<uint32_t> slotOfBlock(
                                         slots, kNoSlot);  // for every other block, from the last one on
                                     uint32_t next = 0;
                                     for (uint32_t block = 0; block < slots; ++block)
                                       if (block % 2 == 0) slotOfBlock[slots - 1 - block] = next++;
                                     a.slotOfBlock = stage.input(slotOfBlock);
                                     slots = next;
                                   }
                                   a.occupancy = stage.input(randomOccupancy(stage.random, slots, share));
                                   watchSamples(stage, size.capacity, optional ? 300 : 60000, a);
                                   stage.device.run(a);
                                 }});
        }
  for (const NamedBlockSpace& named : blockSpaces())
    for (float share : {0.1f, 1.0f})
      tests.cases.push_back({fmt::format("{}, {} occupied, in rounds", named.name, share), [=](Stage& stage) {
                               const uint32_t count = 37;
                               const BlockRays rays(stage.random, named.space, count);
                               MarchBlocks a{named.space};
                               a.cells = kCells;
                               a.step = 0.035f;
                               a.rays.capacity = count;
                               a.maxOpticalDepth = 0.8f;
                               a.origins = stage.input(rays.origins);
                               a.directions = stage.input(rays.directions);
                               a.jitter = stage.randomInput(count, 0, 1);
                               a.occupancy = stage.input(randomOccupancy(stage.random, named.space.blocks(), share));
                               a.opticalDepth = stage.input(stage.random.floats(count, 0, 1));
                               a.nextStep = stage.outputWords("nextStep", std::vector<uint32_t>(count));
                               for (const uint32_t maximum : {5u, 0u, 1u, 15u, ~0u}) {  // the fourth round does not fit
                                 a.maximum = maximum;
                                 watchSamples(stage, count, 300, a);
                                 stage.device.run(a);
                               }
                             }});
  return tests;
}

}  // namespace tessera::device_test

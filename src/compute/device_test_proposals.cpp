// Test cases of proposal sampling.
#include <fmt/format.h>

#include <algorithm>

#include "compute/device_test.h"
#include "compute/proposals.h"

namespace tessera::device_test {
namespace {

// [rays][intervals + 1], increasing, and no two nearly equal.
std::vector<float> randomFences(Random& random, size_t rays, uint32_t intervals) {
  std::vector<float> fences;
  for (size_t r = 0; r < rays; ++r) {
    std::vector<float> ofRay = random.floats(intervals + 1, 0, 1);
    double sum = 0;
    for (float& width : ofRay) width = static_cast<float>(sum += 0.05 + width);
    for (float width : ofRay) fences.push_back(static_cast<float>((width - ofRay[0]) / (sum - ofRay[0])));
  }
  return fences;
}

// Weights that are zero on some rays, and concentrated in one interval on others.
std::vector<float> randomWeights(Random& random, size_t rays, uint32_t intervals) {
  std::vector<float> weights = random.floats(rays * intervals, 0, 1);
  for (size_t i = 0; i < weights.size(); ++i) {
    const size_t ray = i / intervals;
    if (ray % 5 == 2 || (ray % 5 == 3 && i % intervals != ray % intervals)) weights[i] = 0;
  }
  return weights;
}

struct InterlevelScene {
  uint32_t intervals;
  std::vector<uint32_t> first;
  std::vector<float> fences, weights, middles, widths, sampleWeights;

  InterlevelScene(Random& random, size_t rays, uint32_t proposed, uint32_t maxSamples)
      : intervals(proposed),
        first(random.firstSamples(rays, maxSamples)),
        fences(randomFences(random, rays, proposed)),
        weights(random.floats(rays * proposed, 0, 0.3f)) {
    for (uint32_t& row : first) row += 3;  // the samples of the first ray need not begin at row 0
    middles = widths = sampleWeights = {0.5f, 0.5f, 0.5f};
    for (size_t r = 0; r < rays; ++r) {
      const uint32_t count = first[r + 1] - first[r];
      const std::vector<float> posts = randomFences(random, 1, count);
      for (uint32_t i = 0; i < count; ++i) {
        middles.push_back((posts[i] + posts[i + 1]) / 2);
        widths.push_back(posts[i + 1] - posts[i]);
        sampleWeights.push_back(random.below(4) == 0 ? 0 : random.uniform(0, 1));
      }
    }
  }
  void nameIn(Stage& stage, InterlevelLoss& a) const {
    a.intervals = intervals;
    a.fences = stage.input(fences);
    a.weights = stage.input(weights);
    a.firstSample = stage.input(first);
    a.middles = stage.input(middles);
    a.widths = stage.input(widths);
    a.sampleWeights = stage.input(sampleWeights);
  }
};

}  // namespace

template <>
OperationTests makeTests<ResampleFences>() {
  OperationTests tests;
  tests.noGradient = "positions have none, by definition";
  struct Shape {
    uint32_t before, after;
    float anneal, uniformFraction;
  };
  for (const Shape& shape : {Shape{64, 32, 1, 0.01f}, Shape{17, 40, 0.4f, 0.05f}, Shape{5, 1, 0, 0.01f},
                             Shape{1, 9, 1, 0.01f}, Shape{13, 8, 1, 0}})
    for (const Size& size : kSizes)
      for (bool jittered : {false, true})
        tests.cases.push_back(
            {fmt::format("{} from {} intervals, anneal {}, padding {}, rays {}{}", shape.after, shape.before,
                         shape.anneal, shape.uniformFraction, toString(size), jittered ? ", jitter" : ""),
             [=](Stage& stage) {
               ResampleFences a;
               a.rays = stage.count(size);
               a.before = shape.before;
               a.after = shape.after;
               a.anneal = shape.anneal;
               a.uniformFraction = shape.uniformFraction;
               a.fences = stage.input(randomFences(stage.random, size.capacity, shape.before));
               a.weights = stage.input(randomWeights(stage.random, size.capacity, shape.before));
               if (jittered) a.jitter = stage.randomInput(size.capacity, 0, 1);
               a.resampled = stage.output("resampled", (shape.after + 1) * size.capacity, 2e-6);
               stage.device.run(a);
             }});
  return tests;
}

template <>
OperationTests makeTests<InterlevelLoss>() {
  OperationTests tests;
  for (uint32_t intervals : {1u, 16u, 64u})
    for (const Size& size : kSizes)
      tests.cases.push_back({fmt::format("{} intervals, rays {}", intervals, toString(size)), [=](Stage& stage) {
                               const InterlevelScene scene(stage.random, size.capacity, intervals, 40);
                               InterlevelLoss a;
                               a.scale = 0.3f;
                               a.rays = stage.count(size);
                               scene.nameIn(stage, a);
                               a.loss = stage.output("loss", 1);
                               a.weightGradients = stage.output("weightGradients", size_t{intervals} * size.capacity);
                               stage.device.run(a);
                             }});
  tests.gradients.push_back(
      {"of the proposal's weights", [](Stage& stage) {
         const uint32_t rays = 9;
         const InterlevelScene scene(stage.random, rays, 12, 20);
         InterlevelLoss a;
         a.scale = 0.7f;
         a.rays = stage.count({rays});
         scene.nameIn(stage, a);
         a.loss = stage.output("loss", 1);
         a.weightGradients = stage.output("weightGradients", scene.weights.size());
         stage.device.run(a);
         const Doubles fences = toDoubles(scene.fences), middles = toDoubles(scene.middles);
         const Doubles widths = toDoubles(scene.widths), seen = toDoubles(scene.sampleWeights);
         const auto loss = [&](View weights) {
           double sum = 0;
           for (size_t r = 0; r < rays; ++r) {
             const size_t first = scene.first[r], count = scene.first[r + 1] - first;
             sum += a.scale *
                    reference::interlevelLossOfRay(View(fences).subspan(13 * r, 13), weights.subspan(12 * r, 12),
                                                   View(middles).subspan(first, count),
                                                   View(widths).subspan(first, count), View(seen).subspan(first, count))
                        .loss;
           }
           return sum;
         };
         return std::vector<GradientPair>{
             {"weights", stage.device.read(a.weightGradients),
              centralDifferences(loss, toDoubles(scene.weights), 1e-6, firstIndices(scene.weights.size()))}};
       }});
  return tests;
}

}  // namespace tessera::device_test

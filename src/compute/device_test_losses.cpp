// Test cases of the losses, exposure and the optimiser.
#include <fmt/format.h>

#include <cmath>

#include "compute/adam.h"
#include "compute/device_test.h"
#include "compute/exposure.h"
#include "compute/losses.h"

namespace tessera::device_test {
namespace {

constexpr ColourLossKind kKinds[] = {ColourLossKind::mse, ColourLossKind::huber, ColourLossKind::charbonnier};
constexpr const char* kKindNames[] = {"mse", "huber", "charbonnier"};

float colourLossParameter(ColourLossKind kind) {
  return kind == ColourLossKind::huber ? 0.1f : 1e-3f;
}

// Weights that exclude every third ray.
std::vector<float> weightsOfRays(Random& random, size_t rays) {
  std::vector<float> weights = random.floats(rays, 0, 2);
  for (size_t i = 0; i < weights.size(); i += 3) weights[i] = 0;
  return weights;
}

}  // namespace

template <>
OperationTests makeTests<ColourLoss>() {
  OperationTests tests;
  for (ColourLossKind kind : kKinds) {
    for (const Size& size : kSizes)
      for (bool weighted : {false, true})
        tests.cases.push_back({fmt::format("{}, rays {}{}", kKindNames[static_cast<int>(kind)], toString(size),
                                           weighted ? ", weights" : ""),
                               [=](Stage& stage) {
                                 const std::vector<float> weights = weightsOfRays(stage.random, size.capacity);
                                 ColourLoss a;
                                 a.kind = kind;
                                 a.parameter = colourLossParameter(kind);
                                 a.scale = 0.7f;
                                 a.rays = stage.count(size);
                                 a.predicted = stage.randomInput(3 * size.capacity, 0, 1);
                                 a.target = stage.randomInput(3 * size.capacity, 0, 1);
                                 if (weighted) a.weights = stage.input(weights);
                                 a.loss = stage.output("loss", 2);
                                 a.gradients = stage.output("gradients", 3 * size.capacity);
                                 stage.device.run(a);
                               }});
    tests.gradients.push_back({kKindNames[static_cast<int>(kind)], [=](Stage& stage) {
                                 const uint32_t rays = 21;
                                 const std::vector<float> predicted = stage.random.floats(3 * rays, 0, 1);
                                 const std::vector<float> target = stage.random.floats(3 * rays, 0, 1);
                                 const std::vector<float> weights = stage.random.floats(rays, 0, 2);
                                 ColourLoss a;
                                 a.kind = kind;
                                 a.parameter = colourLossParameter(kind);
                                 a.scale = 0.3f;
                                 a.rays.capacity = rays;
                                 a.predicted = stage.input(predicted);
                                 a.target = stage.input(target);
                                 a.weights = stage.input(weights);
                                 a.loss = stage.output("loss", 2);
                                 a.gradients = stage.output("gradients", 3 * rays);
                                 stage.device.run(a);
                                 const auto loss = [&](View p) {
                                   double sum = 0;
                                   for (size_t i = 0; i < p.size(); ++i)
                                     sum += a.scale * weights[i / 3] *
                                            reference::colourLoss(kind, a.parameter, p[i] - target[i]).value;
                                   return sum;
                                 };
                                 return std::vector<GradientPair>{{"predicted", stage.device.read(a.gradients),
                                                                   centralDifferences(loss, toDoubles(predicted), 1e-7,
                                                                                      firstIndices(predicted.size()))}};
                               }});
  }
  return tests;
}

template <>
OperationTests makeTests<DistortionLoss>() {
  OperationTests tests;
  for (const Size& size : kSizes)
    for (bool normalised : {false, true})
      tests.cases.push_back(
          {fmt::format("rays {}{}", toString(size), normalised ? ", normalised" : ""), [=](Stage& stage) {
             const std::vector<uint32_t> first = stage.random.firstSamples(size.capacity, 40);
             std::vector<float> distances;  // increasing along a ray, on both sides of the seam of the warp at 1
             for (uint32_t ray = 0; ray < size.capacity; ++ray)
               for (uint32_t i = 0; i < first[ray + 1] - first[ray]; ++i)
                 distances.push_back(0.2f + 0.05f * static_cast<float>(i) + stage.random.uniform(0, 0.04f));
             DistortionLoss a;
             a.scale = 0.01f;
             a.normalised = normalised;
             a.rays = stage.count(size);
             a.firstSample = stage.input(first);
             a.weights = stage.randomInput(first.back(), 0, 0.1f);
             a.distances = stage.input(distances);
             a.steps = stage.randomInput(first.back(), 0.01f, 0.05f);
             a.loss = stage.output("loss", 1, 1e-4);
             a.weightGradients = stage.output("weightGradients", first.back(), 1e-4);
             stage.device.run(a);
           }});
  for (bool normalised : {false, true})
    tests.gradients.push_back({normalised ? "one ray, normalised" : "one ray", [=](Stage& stage) {
                                 const uint32_t samples = 14;
                                 const std::vector<float> weights = stage.random.floats(samples, 0, 0.2f);
                                 const std::vector<float> steps = stage.random.floats(samples, 0.01f, 0.1f);
                                 std::vector<float> distances;
                                 for (uint32_t i = 0; i < samples; ++i)
                                   distances.push_back(0.3f + 0.12f * static_cast<float>(i));
                                 DistortionLoss a;
                                 a.scale = 1.5f;
                                 a.normalised = normalised;
                                 a.rays.capacity = 1;
                                 a.firstSample = stage.input(std::vector<uint32_t>{0, samples});
                                 a.weights = stage.input(weights);
                                 a.distances = stage.input(distances);
                                 a.steps = stage.input(steps);
                                 a.loss = stage.output("loss", 1);
                                 a.weightGradients = stage.output("weightGradients", samples);
                                 stage.device.run(a);
                                 const Doubles t = toDoubles(distances), dt = toDoubles(steps);
                                 const auto loss = [&](View w) {
                                   return a.scale * reference::distortionOfRay(w, t, dt, normalised).loss;
                                 };
                                 return std::vector<GradientPair>{
                                     {"weights", stage.device.read(a.weightGradients),
                                      centralDifferences(loss, toDoubles(weights), 1e-5, firstIndices(samples))}};
                               }});
  return tests;
}

template <>
OperationTests makeTests<DepthLoss>() {
  OperationTests tests;
  for (const Size& size : kSizes)
    tests.cases.push_back({"rays " + toString(size), [=](Stage& stage) {
                             const std::vector<uint32_t> first = stage.random.firstSamples(size.capacity, 40);
                             std::vector<float> known = stage.random.floats(size.capacity, 0.5f, 4);
                             for (size_t ray = 0; ray < known.size(); ray += 3) known[ray] = 0;
                             DepthLoss a;
                             a.scale = 0.3f;
                             a.rays = stage.count(size);
                             a.firstSample = stage.input(first);
                             a.weights = stage.randomInput(first.back(), 0, 0.1f);
                             a.distances = stage.randomInput(first.back(), 0.1f, 6);
                             a.known = stage.input(known);
                             a.loss = stage.output("loss", 1);
                             a.weightGradients =
                                 stage.output("weightGradients", stage.random.floats(first.back(), -1, 1));
                             stage.device.run(a);
                           }});
  tests.gradients.push_back(
      {"two rays", [=](Stage& stage) {
         const std::vector<uint32_t> first = {0, 9, 17};
         const std::vector<float> weights = stage.random.floats(17, 0, 0.2f), known = {1.1f, 0.4f};
         const std::vector<float> distances = stage.random.floats(17, 0.2f, 2);
         DepthLoss a;
         a.scale = 1.5f;
         a.tolerance = 0.1f;
         a.rays.capacity = 2;
         a.firstSample = stage.input(first);
         a.weights = stage.input(weights);
         a.distances = stage.input(distances);
         a.known = stage.input(known);
         a.loss = stage.output("loss", 1);
         a.weightGradients = stage.input(std::vector<float>(17));
         stage.device.run(a);
         const Doubles t = toDoubles(distances);
         const auto loss = [&](View w) {
           return a.scale *
                  (reference::depthLossOfRay(known[0], a.tolerance, w.subspan(0, 9), View(t).subspan(0, 9)).loss +
                   reference::depthLossOfRay(known[1], a.tolerance, w.subspan(9), View(t).subspan(9)).loss);
         };
         return std::vector<GradientPair>{{"weights", stage.device.read(a.weightGradients),
                                           centralDifferences(loss, toDoubles(weights), 1e-5, firstIndices(17))}};
       }});
  return tests;
}

template <>
OperationTests makeTests<S3imLoss>() {
  OperationTests tests;
  for (const Size& size : kSizes)
    for (bool weighted : {false, true})
      tests.cases.push_back({fmt::format("rays {}{}", toString(size), weighted ? ", weights" : ""), [=](Stage& stage) {
                               S3imLoss a;
                               a.scale = 0.7f;
                               a.rays = stage.count(size);
                               a.patches = size.capacity == 130 ? 1 : 10;
                               a.seed = 1234567890123 + size.capacity;
                               a.predicted = stage.randomInput(3 * size.capacity, 0, 1);
                               a.target = stage.randomInput(3 * size.capacity, 0, 1);
                               if (weighted) a.weights = stage.input(weightsOfRays(stage.random, size.capacity));
                               a.loss = stage.output("loss", 1);
                               a.gradients =
                                   stage.output("gradients", stage.random.floats(3 * size.capacity, 0, 1e-3f));
                               stage.device.run(a);
                             }});
  for (bool alike : {false, true})
    tests.gradients.push_back({alike ? "nearly alike" : "unlike", [=](Stage& stage) {
                                 const uint32_t rays = 53;
                                 const std::vector<float> target = stage.random.floats(3 * rays, 0, 1);
                                 std::vector<float> predicted = stage.random.floats(3 * rays, 0, 1);
                                 if (alike)
                                   for (size_t i = 0; i < predicted.size(); ++i)
                                     predicted[i] = target[i] + 0.1f * (predicted[i] - 0.5f);
                                 const std::vector<float> weights = weightsOfRays(stage.random, rays);
                                 S3imLoss a;
                                 a.scale = 0.3f;
                                 a.rays.capacity = rays;
                                 a.patches = 3;
                                 a.seed = 9;
                                 a.predicted = stage.input(predicted);
                                 a.target = stage.input(target);
                                 a.weights = stage.input(weights);
                                 a.loss = stage.output("loss", 1);
                                 a.gradients = stage.input(std::vector<float>(3 * rays));
                                 stage.device.run(a);
                                 // A ray of weight 0 counts as equal, so its prediction and its target are both fixed.
                                 const Doubles y = toDoubles(target), w = toDoubles(weights),
                                               original = toDoubles(predicted);
                                 const auto loss = [&](View x) {
                                   Doubles moved(x.begin(), x.end()), beside = y;
                                   for (size_t i = 0; i < moved.size(); ++i)
                                     if (w[i / 3] == 0) beside[i] = moved[i] = original[i];
                                   return a.scale * reference::s3imLoss(moved, beside, {}, a.patches, a.seed).loss;
                                 };
                                 return std::vector<GradientPair>{{"predicted", stage.device.read(a.gradients),
                                                                   centralDifferences(loss, toDoubles(predicted), 1e-6,
                                                                                      firstIndices(predicted.size()))}};
                               }});
  return tests;
}

template <>
OperationTests makeTests<OpacityLoss>() {
  OperationTests tests;
  for (const Size& size : kSizes)
    tests.cases.push_back({"segments " + toString(size), [=](Stage& stage) {
                             std::vector<float> opacities = stage.random.floats(size.capacity, 0, 1);
                             for (size_t i = 0; i < opacities.size(); i += 5) {
                               constexpr float kEdges[] = {0, 1, 1e-6f, 1 - 0x1p-24f, 2e-5f, 1 - 2e-5f};
                               opacities[i] = kEdges[stage.random.below(6)];
                             }
                             OpacityLoss a;
                             a.scale = 0.7f;
                             a.segments = stage.count(size);
                             a.opacities = stage.input(opacities);
                             a.loss = stage.output("loss", 1);
                             a.opacityGradients =
                                 stage.output("opacityGradients", stage.random.floats(size.capacity, -1, 1));
                             stage.device.run(a);
                           }});
  tests.gradients.push_back({"from clear to opaque", [=](Stage& stage) {
                               const std::vector<float> opacities = stage.random.floats(31, 0.02f, 0.98f);
                               OpacityLoss a;
                               a.scale = 0.3f;
                               a.segments.capacity = 31;
                               a.opacities = stage.input(opacities);
                               a.loss = stage.output("loss", 1);
                               a.opacityGradients = stage.input(std::vector<float>(31));
                               stage.device.run(a);
                               const auto loss = [&](View moved) {
                                 double sum = 0;
                                 for (double opacity : moved) sum += a.scale * reference::opacityLoss(opacity).value;
                                 return sum;
                               };
                               return std::vector<GradientPair>{
                                   {"opacities", stage.device.read(a.opacityGradients),
                                    centralDifferences(loss, toDoubles(opacities), 1e-6, firstIndices(31))}};
                             }});
  return tests;
}

template <>
OperationTests makeTests<SparsityLoss>() {
  OperationTests tests;
  for (const Size& size : kSizes)
    tests.cases.push_back({"points " + toString(size), [=](Stage& stage) {
                             SparsityLoss a;
                             a.scale = 0.7f;
                             a.points = stage.count(size);
                             a.logDensities = stage.randomInput(size.capacity, -25, 25);
                             a.runtimeSteps = stage.randomInput(size.capacity, 1e-4f, 1e-2f);
                             a.loss = stage.output("loss", 1);
                             a.gradients = stage.output("gradients", size.capacity);
                             stage.device.run(a);
                           }});
  tests.gradients.push_back({"from clear to opaque", [=](Stage& stage) {
                               const std::vector<float> logDensities = stage.random.floats(31, -4, 9);
                               const std::vector<float> steps = stage.random.floats(31, 1e-3f, 1e-2f);
                               SparsityLoss a;
                               a.scale = 0.3f;
                               a.points.capacity = 31;
                               a.logDensities = stage.input(logDensities);
                               a.runtimeSteps = stage.input(steps);
                               a.loss = stage.output("loss", 1);
                               a.gradients = stage.output("gradients", 31);
                               stage.device.run(a);
                               const auto loss = [&](View moved) {
                                 double sum = 0;
                                 for (size_t i = 0; i < moved.size(); ++i)
                                   sum += a.scale * reference::sparsityLoss(moved[i], steps[i]).value;
                                 return sum;
                               };
                               return std::vector<GradientPair>{
                                   {"logDensities", stage.device.read(a.gradients),
                                    centralDifferences(loss, toDoubles(logDensities), 1e-5, firstIndices(31))}};
                             }});
  return tests;
}

template <>
OperationTests makeTests<ExposureForward>() {
  OperationTests tests;
  tests.noGradient = "its gradient is ExposureBackward";
  for (const Size& size : kSizes)
    for (bool background : {false, true})
      tests.cases.push_back(
          {fmt::format("rays {}{}", toString(size), background ? ", background" : ""), [=](Stage& stage) {
             ExposureForward a;
             a.rays = stage.count(size);
             a.colours = stage.randomInput(3 * size.capacity, 0, 1);
             if (background) {
               a.opacity = stage.randomInput(size.capacity, 0, 1);
               a.background = stage.randomInput(3 * size.capacity, 0, 1);
             }
             a.photoOfRay = stage.input(stage.random.wordsBelow(size.capacity, 7));
             a.logGains = stage.randomInput(3 * 7, -2, 2);
             a.exposed = stage.output("exposed", 3 * size.capacity);
             stage.device.run(a);
           }});
  return tests;
}

template <>
OperationTests makeTests<ExposureBackward>() {
  OperationTests tests;
  for (const Size& size : kSizes)
    for (bool inPlace : {false, true})
      tests.cases.push_back(
          {fmt::format("rays {}{}", toString(size), inPlace ? ", in place, background" : ""), [=](Stage& stage) {
             const std::vector<float> upstream = stage.random.floats(3 * size.capacity, -1, 1);
             ExposureBackward a;
             a.rays = stage.count(size);
             a.colours = stage.randomInput(3 * size.capacity, 0, 1);
             a.photoOfRay = stage.input(stage.random.wordsBelow(size.capacity, 7));
             a.logGains = stage.randomInput(3 * 7, -2, 2);
             if (inPlace) {
               a.background = stage.randomInput(3 * size.capacity, 0, 1);
               a.opacityGradients = stage.output("opacityGradients", size.capacity);
               a.colourGradients = stage.output("colourGradients", upstream);
               a.exposedGradients = a.colourGradients;
             } else {
               a.colourGradients = stage.output("colourGradients", 3 * size.capacity);
               a.exposedGradients = stage.input(upstream);
             }
             a.logGainGradients = stage.output("logGainGradients", stage.random.floats(3 * 7, -1, 1));
             stage.device.run(a);
           }});
  tests.gradients.push_back(
      {"three photos", [=](Stage& stage) {
         const uint32_t rays = 23, photos = 3;
         const std::vector<float> colours = stage.random.floats(3 * rays, 0, 1);
         const std::vector<float> gains = stage.random.floats(3 * photos, -1, 1);
         const std::vector<float> opacity = stage.random.floats(rays, 0, 1);
         const std::vector<float> background = stage.random.floats(3 * rays, 0, 1);
         const std::vector<float> upstream = stage.random.floats(3 * rays, -1, 1);
         const std::vector<uint32_t> photoOfRay = stage.random.wordsBelow(rays, photos);
         ExposureBackward a;
         a.rays.capacity = rays;
         a.colours = stage.input(colours);
         a.background = stage.input(background);
         a.photoOfRay = stage.input(photoOfRay);
         a.logGains = stage.input(gains);
         a.exposedGradients = stage.input(upstream);
         a.colourGradients = stage.output("colourGradients", 3 * rays);
         a.opacityGradients = stage.output("opacityGradients", rays);
         a.logGainGradients = stage.input(std::vector<float>(3 * photos));
         stage.device.run(a);
         const auto loss = [&](View c, View o, View g) {
           double sum = 0;
           for (size_t i = 0; i < c.size(); ++i)
             sum += upstream[i] * (c[i] * std::exp2(g[3 * photoOfRay[i / 3] + i % 3]) + (1 - o[i / 3]) * background[i]);
           return sum;
         };
         const Doubles c = toDoubles(colours), o = toDoubles(opacity), g = toDoubles(gains);
         return std::vector<GradientPair>{
             {"colours", stage.device.read(a.colourGradients),
              centralDifferences([&](View moved) { return loss(moved, o, g); }, c, 1e-5, firstIndices(c.size()))},
             {"opacity", stage.device.read(a.opacityGradients),
              centralDifferences([&](View moved) { return loss(c, moved, g); }, o, 1e-5, firstIndices(o.size()))},
             {"gains", stage.device.read(a.logGainGradients),
              centralDifferences([&](View moved) { return loss(c, o, moved); }, g, 1e-5, firstIndices(g.size()))}};
       }});
  return tests;
}

template <>
OperationTests makeTests<Adam>() {
  OperationTests tests;
  tests.noGradient = "it is the optimiser";
  for (uint32_t count : {1u, 37u, 1061u, 150001u})
    for (bool skip : {false, true})
      for (float l2 : {0.0f, 1e-2f})
        tests.cases.push_back({fmt::format("{} parameters{}, l2 {}", count, skip ? ", zero gradients skipped" : "", l2),
                               [=](Stage& stage) {
                                 std::vector<float> gradients = stage.random.floats(count, -1, 1);
                                 std::vector<uint32_t> counts = stage.random.wordsBelow(count, 300);
                                 for (size_t i = 0; i < count; ++i) {
                                   // Runs of zeros longer than any vector, as in hash tables; negative zero counts as
                                   // zero.
                                   if (i / 64 % 2 == 1 || stage.random.below(4) == 0)
                                     gradients[i] = stage.random.below(2) ? 0.0f : -0.0f;
                                   if (i % 50 == 7) counts[i] = 0;
                                   if (i % 50 == 8) counts[i] = 5000000;
                                 }
                                 Adam a;
                                 a.skipZeroGradients = skip;
                                 a.l2 = l2;
                                 if (count == 150001) a.bound = 0.7f;
                                 if (count == 1061) a.rows = stage.input(std::vector<uint32_t>{7, skip ? 7u : 8u});
                                 // Counters that stay within the capacity, or exceed it.
                                 if (count == 37)
                                   a.overflowCounters = stage.input(std::vector<uint32_t>{7, skip ? 9u : 8u, 3});
                                 a.capacity = 8;
                                 a.parameters = stage.output("parameters", stage.random.floats(count, -1, 1));
                                 a.gradients = stage.output("gradients", gradients);
                                 a.firstMoments = stage.output("firstMoments", stage.random.floats(count, -0.1f, 0.1f));
                                 a.secondMoments =
                                     stage.output("secondMoments", stage.random.floats(count, 1e-4f, 0.1f));
                                 a.counts = stage.outputWords("counts", counts);
                                 stage.device.run(a);
                               }});
  return tests;
}

}  // namespace tessera::device_test

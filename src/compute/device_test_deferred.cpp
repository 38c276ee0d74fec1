// Test cases of deferred networks and of blending blocks.
#include <fmt/format.h>

#include "compute/blend.h"
#include "compute/deferred.h"
#include "compute/device_test.h"

namespace tessera::device_test {
namespace {

constexpr uint32_t kNetworks = 5;  // no segment uses the last of them

// The segments of rays through blocks; those of one ray are consecutive.
struct Scene {
  uint32_t rays;
  std::vector<uint32_t> network, ray;
  std::vector<float> composited, directions, networks;

  Scene(Random& random, uint32_t segments) : rays(segments / 2 + 1) {
    network = random.wordsBelow(segments, kNetworks - 1);
    for (uint32_t s = 0; s < segments; ++s) ray.push_back(s * rays / segments);
    composited = random.floats(7 * segments, 0, 1);
    directions = random.directions(rays);
    networks = random.floats(kNetworks * DeferredNetwork::kParameters, -0.5f, 0.5f);
  }
};

// Sets the arguments that forward and backward share.
template <class Arguments>
void setInputs(Stage& stage, const Scene& scene, const Size& size, Arguments& a) {
  a.segments = stage.count(size);
  a.composited = stage.input(scene.composited);
  a.networkOfSegment = stage.input(scene.network);
  a.rayOfSegment = stage.input(scene.ray);
  a.directions = stage.input(scene.directions);
  a.networks = stage.input(scene.networks);
}

struct BlendScene {
  std::vector<uint32_t> first;
  std::vector<float> composited, specular, opacities, depths;

  BlendScene(Random& random, size_t rays) : first(random.firstSamples(rays, 5)) {
    const size_t segments = first.back();
    composited = random.floats(7 * segments, 0, 1);
    specular = random.floats(3 * segments, 0, 1);
    opacities = random.floats(segments, 0, 1);
    depths = random.floats(segments, 0, 5);
    for (size_t s = 0; s < segments; s += 7) opacities[s] = random.below(2) ? 1.0f : 0.0f;
  }
};

template <class Arguments>
void setInputs(Stage& stage, const BlendScene& scene, const Size& size, bool literal, Arguments& a) {
  a.literal = literal;
  a.rays = stage.count(size);
  a.firstSegment = stage.input(scene.first);
  a.composited = stage.input(scene.composited);
  a.specular = stage.input(scene.specular);
  a.opacities = stage.input(scene.opacities);
}

std::string caseName(const Size& size, bool literal) {
  return fmt::format("rays {}{}", toString(size), literal ? ", literal" : "");
}

}  // namespace

template <>
OperationTests makeTests<DeferredForward>() {
  OperationTests tests;
  tests.noGradient = "its gradient is DeferredBackward";
  for (const Size& size : kSizes)
    tests.cases.push_back({"segments " + toString(size), [=](Stage& stage) {
                             const Scene scene(stage.random, size.capacity);
                             DeferredForward a;
                             setInputs(stage, scene, size, a);
                             a.specular = stage.output("specular", 3 * size.capacity);
                             stage.device.run(a);
                           }});
  return tests;
}

template <>
OperationTests makeTests<DeferredBackward>() {
  OperationTests tests;
  for (const Size& size : kSizes)
    tests.cases.push_back({"segments " + toString(size), [=](Stage& stage) {
                             const Scene scene(stage.random, size.capacity);
                             DeferredBackward a;
                             setInputs(stage, scene, size, a);
                             a.specularGradients = stage.randomInput(3 * size.capacity, -1, 1);
                             a.compositedGradients = stage.output("compositedGradients",
                                                                  stage.random.floats(7 * size.capacity, -0.1f, 0.1f));
                             a.networkGradients = stage.output("networkGradients",
                                                               stage.random.floats(scene.networks.size(), -0.1f, 0.1f));
                             stage.device.run(a);
                           }});
  tests.gradients.push_back(
      {"nine segments", [=](Stage& stage) {
         const Size size{9};
         const Scene scene(stage.random, size.capacity);
         const std::vector<float> upstream = stage.random.floats(3 * size.capacity, -1, 1);
         DeferredBackward a;
         setInputs(stage, scene, size, a);
         a.specularGradients = stage.input(upstream);
         a.compositedGradients = stage.input(std::vector<float>(scene.composited.size()));
         a.networkGradients = stage.input(std::vector<float>(scene.networks.size()));
         stage.device.run(a);

         const Doubles directions = toDoubles(scene.directions);
         const auto loss = [&](View composited, View networks) {
           double sum = 0;
           for (size_t s = 0; s < size.capacity; ++s) {
             const size_t first = size_t{scene.network[s]} * DeferredNetwork::kParameters;
             const reference::Point colour =
                 reference::deferredForward(networks.subspan(first, DeferredNetwork::kParameters),
                                            composited.subspan(7 * s, 7), &directions[3 * scene.ray[s]]);
             for (size_t c = 0; c < 3; ++c) sum += upstream[3 * s + c] * colour[c];
           }
           return sum;
         };
         const Doubles x = toDoubles(scene.composited), w = toDoubles(scene.networks);
         return std::vector<GradientPair>{
             {"composited", stage.device.read(a.compositedGradients),
              centralDifferences([&](View moved) { return loss(moved, w); }, x, 1e-6, firstIndices(x.size()))},
             {"networks", stage.device.read(a.networkGradients),
              centralDifferences([&](View moved) { return loss(x, moved); }, w, 1e-6, firstIndices(w.size()))}};
       }});
  return tests;
}

template <>
OperationTests makeTests<BlendForward>() {
  OperationTests tests;
  tests.noGradient = "its gradient is BlendBackward";
  for (const Size& size : kSizes)
    for (bool literal : {false, true})
      tests.cases.push_back({caseName(size, literal), [=](Stage& stage) {
                               const BlendScene scene(stage.random, size.capacity);
                               BlendForward a;
                               setInputs(stage, scene, size, literal, a);
                               a.depths = stage.input(scene.depths);
                               a.colour = stage.output("colour", 3 * size.capacity);
                               a.opacity = stage.output("opacity", size.capacity);
                               a.depth = stage.output("depth", size.capacity);
                               stage.device.run(a);
                             }});
  return tests;
}

template <>
OperationTests makeTests<BlendBackward>() {
  OperationTests tests;
  for (const Size& size : kSizes)
    for (bool literal : {false, true})
      for (bool opacity : {false, true})
        tests.cases.push_back(
            {fmt::format("{}{}", caseName(size, literal), opacity ? ", opacity" : ""), [=](Stage& stage) {
               const BlendScene scene(stage.random, size.capacity);
               BlendBackward a;
               setInputs(stage, scene, size, literal, a);
               a.rayColourGradients = stage.randomInput(3 * size.capacity, -1, 1);
               if (opacity) a.rayOpacityGradients = stage.randomInput(size.capacity, -1, 1);
               a.compositedGradients = stage.output("compositedGradients", scene.composited.size());
               a.specularGradients = stage.output("specularGradients", scene.specular.size());
               a.opacityGradients = stage.output("opacityGradients", scene.opacities.size());
               stage.device.run(a);
             }});
  for (bool literal : {false, true})
    tests.gradients.push_back(
        {literal ? "literal" : "gated", [=](Stage& stage) {
           const Size size{12};
           const BlendScene scene(stage.random, size.capacity);
           const std::vector<float> colour = stage.random.floats(3 * size.capacity, -1, 1);
           const std::vector<float> opacity = stage.random.floats(size.capacity, -1, 1);
           BlendBackward a;
           setInputs(stage, scene, size, literal, a);
           a.rayColourGradients = stage.input(colour);
           a.rayOpacityGradients = stage.input(opacity);
           a.compositedGradients = stage.output("compositedGradients", scene.composited.size());
           a.specularGradients = stage.output("specularGradients", scene.specular.size());
           a.opacityGradients = stage.output("opacityGradients", scene.opacities.size());
           stage.device.run(a);

           const auto loss = [&](View composited, View specular, View opacities) {
             double sum = 0;
             for (size_t r = 0; r < size.capacity; ++r) {
               const size_t first = scene.first[r], count = scene.first[r + 1] - first;
               const reference::BlendedRay ray = reference::blendRay(literal, {composited.subspan(7 * first, 7 * count),
                                                                               specular.subspan(3 * first, 3 * count),
                                                                               opacities.subspan(first, count),
                                                                               {}});
               for (size_t c = 0; c < 3; ++c) sum += colour[3 * r + c] * ray.colour[c];
               sum += opacity[r] * ray.opacity;
             }
             return sum;
           };
           const Doubles x = toDoubles(scene.composited), s = toDoubles(scene.specular);
           const Doubles alpha = toDoubles(scene.opacities);
           return std::vector<GradientPair>{
               {"composited", stage.device.read(a.compositedGradients),
                centralDifferences([&](View moved) { return loss(moved, s, alpha); }, x, 1e-4, firstIndices(x.size()))},
               {"specular", stage.device.read(a.specularGradients),
                centralDifferences([&](View moved) { return loss(x, moved, alpha); }, s, 1e-4, firstIndices(s.size()))},
               {"opacities", stage.device.read(a.opacityGradients),
                centralDifferences([&](View moved) { return loss(x, s, moved); }, alpha, 1e-4,
                                   firstIndices(alpha.size()))}};
         }});
  return tests;
}

}  // namespace tessera::device_test

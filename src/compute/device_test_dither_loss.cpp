// Test cases of the loss of dithering.
#include <fmt/format.h>

#include "compute/device_test.h"
#include "compute/losses.h"

namespace tessera::device_test {
namespace {

constexpr Layout kColourLayouts[] = {Layout::plain, Layout::strided};

struct DitheredRays {
  std::vector<uint32_t> first;
  std::vector<float> weights, colours, colour, opacity, background, rayWeights;

  DitheredRays(Random& random, uint32_t rays, bool hasBackground, bool isWeighted) {
    first = random.firstSamples(rays, 20);
    weights = random.floats(first.back(), 0, 0.2f);
    colours = random.floats(size_t{3} * first.back(), 0, 1);
    colour = random.floats(size_t{3} * rays, 0, 1);
    opacity = random.floats(rays, 0, 1);
    if (hasBackground) background = random.floats(size_t{3} * rays, 0, 1);
    if (isWeighted) rayWeights = random.floats(rays, 0, 2);
    for (size_t ray = 0; ray < rayWeights.size(); ray += 3) rayWeights[ray] = 0;
  }
  size_t samples() const { return first.back(); }

  void set(Stage& stage, DitherLoss& a, Layout layout) const {
    a.scale = 0.7f;
    a.firstSample = stage.input(first);
    a.weights = stage.input(weights);
    a.colours = stage.makeMatrix(colours, 3, layout);
    a.colour = stage.input(colour);
    a.background = stage.input(background);
    a.rayWeights = stage.input(rayWeights);
    if (a.background) a.opacity = stage.input(opacity);
  }
};

}  // namespace

template <>
OperationTests makeTests<DitherLoss>() {
  OperationTests tests;
  for (const Size& size : kSizes)
    for (const bool hasBackground : {false, true})
      for (const bool isWeighted : {false, true}) {
        const Layout layout = kColourLayouts[hasBackground];
        tests.cases.push_back(
            {fmt::format("rays {}{}{}", toString(size), hasBackground ? ", background" : "",
                         isWeighted ? ", weights" : ""),
             [=](Stage& stage) {
               const DitheredRays rays(stage.random, size.capacity, hasBackground, isWeighted);
               DitherLoss a;
               rays.set(stage, a, layout);
               a.rays = stage.count(size);
               a.loss = stage.output("loss", 1, 1e-4);
               a.weightGradients = stage.output("weightGradients", rays.samples());
               a.colourGradients = stage.outputMatrix("colourGradients", rays.samples(), 3, layout);
               const std::vector<float> initial = stage.random.floats(a.colourGradients.data.count, -1, 1);
               if (!initial.empty()) stage.device.write(a.colourGradients.data, std::span<const float>(initial));
               a.rayColourGradients =
                   stage.output("rayColourGradients", stage.random.floats(size_t{3} * size.capacity, -1, 1));
               if (hasBackground)
                 a.rayOpacityGradients = stage.output("rayOpacityGradients", stage.random.floats(size.capacity, -1, 1));
               stage.device.run(a);
             }});
      }
  tests.gradients.push_back(
      {"several rays", [=](Stage& stage) {
         const uint32_t count = 9;
         const DitheredRays rays(stage.random, count, true, true);
         DitherLoss a;
         rays.set(stage, a, Layout::plain);
         a.rays.capacity = count;
         a.loss = stage.output("loss", 1);
         a.weightGradients = stage.output("weightGradients", rays.samples());
         a.colourGradients = Matrix<float>(stage.input(std::vector<float>(rays.colours.size())), 3);
         a.rayColourGradients = stage.input(std::vector<float>(rays.colour.size()));
         a.rayOpacityGradients = stage.input(std::vector<float>(count));
         stage.device.run(a);
         const Doubles background = toDoubles(rays.background);
         const auto loss = [&](View weights, View colours, View colour, View opacity) {
           double sum = 0;
           for (size_t ray = 0; ray < count; ++ray) {
             const size_t first = rays.first[ray], samples = rays.first[ray + 1] - first, c = 3 * ray;
             sum += a.scale * rays.rayWeights[ray] *
                    reference::ditherLossOfRay(weights.subspan(first, samples), colours.subspan(3 * first, 3 * samples),
                                               {colour[c], colour[c + 1], colour[c + 2]}, opacity[ray],
                                               {background[c], background[c + 1], background[c + 2]});
           }
           return sum;
         };
         const Doubles w = toDoubles(rays.weights), c = toDoubles(rays.colours), all = toDoubles(rays.colour),
                       o = toDoubles(rays.opacity);
         const auto slopes = [](const auto& f, const Doubles& x) {
           return centralDifferences(f, x, 1e-4, firstIndices(x.size()));
         };
         return std::vector<GradientPair>{
             {"loss", stage.device.read(a.loss), {loss(w, c, all, o)}},
             {"weights", stage.device.read(a.weightGradients), slopes([&](View x) { return loss(x, c, all, o); }, w)},
             {"colours", stage.device.read(a.colourGradients.data),
              slopes([&](View x) { return loss(w, x, all, o); }, c)},
             {"ray colours", stage.device.read(a.rayColourGradients),
              slopes([&](View x) { return loss(w, c, x, o); }, all)},
             {"opacity", stage.device.read(a.rayOpacityGradients),
              slopes([&](View x) { return loss(w, c, all, x); }, o)}};
       }});
  return tests;
}

}  // namespace tessera::device_test

// Test cases of volume rendering.
#include <fmt/format.h>

#include <algorithm>

#include "compute/composite.h"
#include "compute/device_test.h"

namespace tessera::device_test {
namespace {

constexpr Extinction kExtinctions[] = {Extinction::opacity, Extinction::density, Extinction::logDensity,
                                       Extinction::logit};
// No column, every number of columns with a specialised kernel, some without one, and the maximum.
constexpr uint32_t kColumns[] = {0, 1, 3, 5, 7, 8, 16};
constexpr const char* kExtinctionNames[] = {"opacity", "density", "log density", "logit"};

// Rays that stay transparent, that end in the middle, and that contain fully opaque samples.
std::vector<float> randomExtinctions(Random& random, Extinction extinction, const std::vector<uint32_t>& first) {
  std::vector<float> x;
  for (size_t ray = 0; ray + 1 < first.size(); ++ray) {
    const float thick = ray % 2 == 0 ? 1.0f : 0.1f;
    for (uint32_t i = first[ray]; i < first[ray + 1]; ++i) {
      const bool opaque = ray % 3 == 2 && random.below(8) == 0;
      switch (extinction) {
        case Extinction::opacity:
          x.push_back(opaque ? 1.0f : random.uniform(0, thick));
          break;
        case Extinction::density:
          x.push_back(opaque ? 1e4f : random.uniform(0, 60 * thick));
          break;
        case Extinction::logDensity:
          x.push_back(opaque ? 14.0f : random.uniform(-3, 2 + 2 * thick));
          break;
        case Extinction::logit:
          x.push_back(opaque ? 30.0f : random.uniform(-3, 4 * thick));
          break;
      }
    }
  }
  return x;
}

struct Scene {
  uint32_t columns;
  std::vector<uint32_t> first;
  std::vector<float> x, steps, distances, colours, background;

  Scene(Random& random, Extinction extinction, size_t rays, uint32_t maxSamples, uint32_t ofColours = 3)
      : columns(ofColours),
        first(random.firstSamples(rays, maxSamples)),
        x(randomExtinctions(random, extinction, first)) {
    steps = random.floats(x.size(), 0.005f, 0.1f);
    distances = random.floats(x.size(), 0.1f, 5);
    colours = random.floats(columns * x.size(), 0, 1);
    background = random.floats(columns * rays, 0, 1);
  }
};

// Sets the arguments that forward and backward share.
template <class Arguments>
void setInputs(Stage& stage, const Scene& scene, Extinction extinction, const Size& size, Layout layout,
               bool withBackground, Arguments& a) {
  a.extinction = extinction;
  a.minTransmittance = size.capacity % 2 ? 1e-4f : 0.01f;
  if (extinction == Extinction::logit) a.offset = -1.5f;
  a.rays = stage.count(size);
  a.firstSample = stage.input(scene.first);
  a.x = stage.makeMatrix(scene.x, 1, layout);
  if (usesSteps(extinction)) a.steps = stage.input(scene.steps);
  a.distances = stage.input(scene.distances);
  if (scene.columns > 0) a.colours = stage.makeMatrix(scene.colours, scene.columns, layout);
  if (withBackground && scene.columns > 0) a.background = stage.input(scene.background);
}

}  // namespace

template <>
OperationTests makeTests<CompositeForward>() {
  OperationTests tests;
  tests.noGradient = "its gradient is CompositeBackward";
  for (Extinction extinction : kExtinctions)
    for (const Size& size : kSizes)
      for (bool strided : {false, true})
        tests.cases.push_back({fmt::format("{}, rays {}{}", kExtinctionNames[static_cast<int>(extinction)],
                                           toString(size), strided ? ", strided, background" : ""),
                               [=](Stage& stage) {
                                 const Scene scene(stage.random, extinction, size.capacity, 50);
                                 CompositeForward a;
                                 setInputs(stage, scene, extinction, size, strided ? Layout::strided : Layout::plain,
                                           strided, a);
                                 a.colour = stage.output("colour", 3 * size.capacity);
                                 a.opacity = stage.output("opacity", size.capacity);
                                 a.depth = stage.output("depth", size.capacity);
                                 a.weights = stage.output("weights", scene.x.size());
                                 stage.device.run(a);
                               }});
  for (uint32_t columns : kColumns)
    for (bool depth : {false, true})
      tests.cases.push_back(
          {fmt::format("{} columns{}", columns, depth ? ", depth, strided, background" : ""), [=](Stage& stage) {
             const Size size{37};
             const Extinction extinction = Extinction::logDensity;
             const Scene scene(stage.random, extinction, size.capacity, 50, columns);
             CompositeForward a;
             setInputs(stage, scene, extinction, size, depth ? Layout::strided : Layout::plain, depth, a);
             if (!depth) a.distances = {};
             if (columns > 0) a.colour = stage.output("colour", columns * size.capacity);
             a.opacity = stage.output("opacity", size.capacity);
             if (depth) a.depth = stage.output("depth", size.capacity);
             a.weights = stage.output("weights", scene.x.size());
             stage.device.run(a);
           }});
  return tests;
}

template <>
OperationTests makeTests<CompositeBackward>() {
  OperationTests tests;
  for (Extinction extinction : kExtinctions)
    for (const Size& size : kSizes)
      for (int optional = 0; optional < 16; ++optional) {
        if (size.capacity > 200 && optional % 5 != 0) continue;
        tests.cases.push_back({fmt::format("{}, rays {}, optional arguments {:04b}",
                                           kExtinctionNames[static_cast<int>(extinction)], toString(size), optional),
                               [=](Stage& stage) {
                                 const Scene scene(stage.random, extinction, size.capacity, 50);
                                 const Layout layout = optional & 1 ? Layout::strided : Layout::plain;
                                 CompositeBackward a;
                                 setInputs(stage, scene, extinction, size, layout, optional & 1, a);
                                 a.rayColourGradients = stage.randomInput(3 * size.capacity, -1, 1);
                                 if (optional & 2) a.rayOpacityGradients = stage.randomInput(size.capacity, -1, 1);
                                 if (optional & 4) a.rayDepthGradients = stage.randomInput(size.capacity, -1, 1);
                                 if (optional & 8) a.weightGradients = stage.randomInput(scene.x.size(), -1, 1);
                                 if (optional & 2) a.fullGradientDistance = 2;
                                 a.xGradients = stage.output("xGradients", scene.x.size());
                                 a.colourGradients = stage.outputMatrix("colourGradients", scene.x.size(), 3, layout);
                                 stage.device.run(a);
                               }});
      }
  for (uint32_t columns : kColumns)
    for (int optional = 0; optional < 4; ++optional)
      tests.cases.push_back(
          {fmt::format("{} columns, optional arguments {:02b}", columns, optional), [=](Stage& stage) {
             const Size size{37};
             const Scene scene(stage.random, Extinction::logDensity, size.capacity, 50, columns);
             const Layout layout = optional & 1 ? Layout::strided : Layout::plain;
             CompositeBackward a;
             setInputs(stage, scene, Extinction::logDensity, size, layout, optional & 1, a);
             if (columns > 0) {
               a.rayColourGradients = stage.randomInput(columns * size.capacity, -1, 1);
               a.colourGradients = stage.outputMatrix("colourGradients", scene.x.size(), columns, layout);
             }
             a.rayOpacityGradients = stage.randomInput(size.capacity, -1, 1);
             a.weightGradients = stage.randomInput(scene.x.size(), -1, 1);
             if (optional & 1) a.fullGradientDistance = 2;
             a.addToXGradients = optional & 2;
             a.xGradients = a.addToXGradients ? stage.output("xGradients", stage.random.floats(scene.x.size(), -1, 1))
                                              : stage.output("xGradients", scene.x.size());
             stage.device.run(a);
           }});
  struct Shape {
    Extinction extinction;
    uint32_t columns;
  };
  std::vector<Shape> shapes;
  for (Extinction extinction : kExtinctions) shapes.push_back({extinction, 3});
  for (uint32_t columns : kColumns) shapes.push_back({Extinction::logDensity, columns});
  for (const auto& [extinction, columns] : shapes)
    for (bool everything : {false, true}) {
      if (columns == 0 && !everything) continue;  // no output has a gradient
      tests.gradients.push_back(
          {fmt::format("{}, {} columns{}", kExtinctionNames[static_cast<int>(extinction)], columns,
                       everything ? ", everything" : ""),
           [=, extinction = extinction, columns = columns](Stage& stage) {
             const Size size{9};
             const Scene scene(stage.random, extinction, size.capacity, 12, columns);
             const size_t rays = size.capacity, samples = scene.x.size();
             const std::vector<float> colour = stage.random.floats(columns * rays, -1, 1);
             const std::vector<float> opacity = stage.random.floats(rays, -1, 1);
             const std::vector<float> depth = stage.random.floats(rays, -1, 1);
             const std::vector<float> weights = stage.random.floats(samples, -1, 1);
             CompositeBackward a;
             setInputs(stage, scene, extinction, size, Layout::plain, everything, a);
             if (columns > 0) {
               a.rayColourGradients = stage.input(colour);
               a.colourGradients = stage.outputMatrix("colourGradients", samples, columns, Layout::plain);
             }
             if (everything) {
               a.rayOpacityGradients = stage.input(opacity);
               a.rayDepthGradients = stage.input(depth);
               a.weightGradients = stage.input(weights);
             }
             a.xGradients = stage.output("xGradients", samples);
             stage.device.run(a);

             const Doubles steps = toDoubles(scene.steps), distances = toDoubles(scene.distances);
             const auto loss = [&](View given, View colours) {
               Doubles x(given.begin(), given.end());
               for (double& value : x) value += a.offset;
               double sum = 0;
               for (size_t r = 0; r < rays; ++r) {
                 const size_t first = scene.first[r], count = scene.first[r + 1] - first;
                 reference::RaySamples ray{View(x).subspan(first, count), View(steps).subspan(first, count),
                                           View(distances).subspan(first, count),
                                           colours.subspan(columns * first, columns * count)};
                 ray.columns = columns;
                 if (everything)
                   for (size_t c = 0; c < columns; ++c) ray.background.push_back(scene.background[columns * r + c]);
                 const reference::RayColour out = reference::compositeRay(extinction, a.minTransmittance, ray);
                 for (size_t c = 0; c < columns; ++c) sum += colour[columns * r + c] * out.colour[c];
                 if (!everything) continue;
                 sum += opacity[r] * out.opacity + depth[r] * out.depth;
                 for (size_t i = 0; i < count; ++i) sum += weights[first + i] * out.weights[i];
               }
               return sum;
             };
             const Doubles x = toDoubles(scene.x), c = toDoubles(scene.colours);
             std::vector<GradientPair> pairs = {
                 {"x", stage.device.read(a.xGradients),
                  centralDifferences([&](View moved) { return loss(moved, c); }, x, 1e-6, firstIndices(samples))}};
             if (columns > 0)
               pairs.push_back({"colours", stage.device.read(a.colourGradients.data),
                                centralDifferences([&](View moved) { return loss(x, moved); }, c, 1e-4,
                                                   firstIndices(columns * samples))});
             return pairs;
           }});
    }
  return tests;
}

namespace {

// Rays of OpaqueForward. No α is within a hundredth of the threshold, and no opacity of `maxOpacity`, so that rounding
// changes no decision.
struct OpaqueRays {
  static constexpr float kThreshold = 0.3f, kMaxOpacity = 0.8f, kOffset = -1;
  std::vector<uint32_t> first;
  std::vector<float> x, colours;

  OpaqueRays(Random& random, size_t rays) : first(1) {
    for (size_t ray = 0; ray < rays; ++ray) {
      const uint32_t count = random.below(30);
      const float thick = ray % 3 == 0 ? 2.0f : 0.2f;
      double transmittance = 1;
      for (uint32_t i = 0; i < count;) {
        const float logit = random.below(9) == 0 ? 20.0f : random.uniform(-4, thick) - kOffset;
        const double alpha = reference::computeOpacity(Extinction::logit, double{logit} + kOffset, 0);
        const double after = transmittance * (alpha > kThreshold ? 1 - alpha : 1);
        if (std::abs(alpha - kThreshold) < 0.01 || std::abs(1 - after - kMaxOpacity) < 0.01) continue;
        x.push_back(logit);
        transmittance = after;
        ++i;
      }
      first.push_back(static_cast<uint32_t>(x.size()));
    }
    colours = random.floats(3 * x.size(), 0, 1);
  }
  template <class Arguments>
  void setInputs(Stage& stage, const Size& size, Layout layout, Arguments& a) const {
    a.threshold = kThreshold;
    a.maxOpacity = kMaxOpacity;
    a.offset = kOffset;
    a.rays = stage.count(size);
    a.firstSample = stage.input(first);
    a.x = stage.makeMatrix(x, 1, layout);
    a.colours = stage.makeMatrix(colours, 3, layout);
  }
};

}  // namespace

template <>
OperationTests makeTests<OpaqueForward>() {
  OperationTests tests;
  tests.noGradient = "its gradient is OpaqueBackward";
  for (const Size& size : kSizes)
    for (const Layout layout : {Layout::plain, Layout::strided})
      tests.cases.push_back(
          {fmt::format("rays {}{}", toString(size), layout == Layout::plain ? "" : ", strided"), [=](Stage& stage) {
             const OpaqueRays rays(stage.random, size.capacity);
             OpaqueForward a;
             rays.setInputs(stage, size, layout, a);
             a.colour = stage.output("colour", 3 * size.capacity);
             a.opacity = stage.output("opacity", size.capacity);
             stage.device.run(a);
           }});
  return tests;
}

template <>
OperationTests makeTests<OpaqueBackward>() {
  OperationTests tests;
  const auto setColours = [](Stage& stage, const OpaqueRays& rays, OpaqueBackward& a) {
    std::vector<float> colours;
    for (size_t ray = 0; ray + 1 < rays.first.size(); ++ray) {
      Doubles alphas;
      for (uint32_t i = rays.first[ray]; i < rays.first[ray + 1]; ++i)
        alphas.push_back(reference::computeOpacity(Extinction::logit, double{rays.x[i]} + a.offset, 0));
      const Doubles all = toDoubles(rays.colours);
      const auto colour =
          reference::compositeOpaque(alphas, View(all).subspan(3 * size_t{rays.first[ray]}, 3 * alphas.size()),
                                     a.threshold, a.maxOpacity, a.minOpacity)
              .colour;
      for (const double c : colour) colours.push_back(static_cast<float>(c));
    }
    a.colour = stage.input(colours);
  };
  for (const Size& size : kSmallSizes)
    for (const Layout layout : {Layout::plain, Layout::strided})
      tests.cases.push_back(
          {fmt::format("rays {}{}", toString(size), layout == Layout::plain ? "" : ", strided"), [=](Stage& stage) {
             const OpaqueRays rays(stage.random, size.capacity);
             OpaqueBackward a;
             rays.setInputs(stage, size, layout, a);
             setColours(stage, rays, a);
             a.rayColourGradients = stage.randomInput(3 * size.capacity, -1, 1);
             a.xGradients = stage.output("xGradients", stage.random.floats(rays.x.size(), -1, 1));
             const std::vector<float> initial = stage.random.floats(3 * rays.x.size(), -1, 1);
             a.colourGradients = Matrix<float>(stage.output("colourGradients", initial), 3);
             stage.device.run(a);
           }});
  tests.gradients.push_back(
      {"logits and colours", [=](Stage& stage) {
         const Size size{20};
         const OpaqueRays rays(stage.random, size.capacity);
         const std::vector<float> g = stage.random.floats(3 * size.capacity, -1, 1);
         OpaqueBackward a;
         rays.setInputs(stage, size, Layout::plain, a);
         setColours(stage, rays, a);
         a.rayColourGradients = stage.input(g);
         a.xGradients = stage.output("xGradients", std::vector<float>(rays.x.size()));
         a.colourGradients = Matrix<float>(stage.output("colourGradients", std::vector<float>(3 * rays.x.size())), 3);
         stage.device.run(a);
         const auto loss = [&](View x, View colours) {
           double sum = 0;
           for (size_t ray = 0; ray < size.capacity; ++ray) {
             const size_t first = rays.first[ray], count = rays.first[ray + 1] - first;
             Doubles alphas;
             for (const double logit : x.subspan(first, count))
               alphas.push_back(reference::computeOpacity(Extinction::logit, logit + a.offset, 0));
             const auto colour = reference::compositeOpaque(alphas, colours.subspan(3 * first, 3 * count), a.threshold,
                                                            a.maxOpacity, a.minOpacity)
                                     .colour;
             for (int c = 0; c < 3; ++c) sum += g[3 * ray + c] * colour[c];
           }
           return sum;
         };
         const Doubles x = toDoubles(rays.x), c = toDoubles(rays.colours);
         return std::vector<GradientPair>{
             {"logits", stage.device.read(a.xGradients),
              centralDifferences([&](View moved) { return loss(moved, c); }, x, 1e-5, firstIndices(x.size()))},
             {"colours", stage.device.read(a.colourGradients.data),
              centralDifferences([&](View moved) { return loss(x, moved); }, c, 1e-4, firstIndices(c.size()))}};
       }});
  return tests;
}

}  // namespace tessera::device_test

// Test cases of cube maps.
#include <fmt/format.h>

#include "compute/cube_map.h"
#include "compute/device_test.h"

namespace tessera::device_test {
namespace {

constexpr uint32_t kCubeMapResolutions[] = {2, 3, 16};

// Directions of any length: most of them anywhere, some along the six axes, on edges and in corners of the cube, where
// components are equal, and some of zero.
std::vector<float> cubeMapDirections(Random& random, size_t count) {
  std::vector<float> directions;
  for (size_t i = 0; i < count; ++i) {
    std::vector<float> direction = random.directions(1);
    const float size = random.uniform(0.1f, 10);
    const auto signedSize = [&] { return random.below(2) ? size : -size; };
    const uint32_t kind = random.below(10), axis = random.below(3);
    for (float& d : direction) d *= size;
    if (kind == 0) {
      direction = {0, 0, 0};
      direction[axis] = signedSize();
    } else if (kind == 1) {
      direction[axis] = random.uniform(-size, size);
      for (const uint32_t other : {axis + 1, axis + 2}) direction[other % 3] = signedSize();
    } else if (kind == 2) {
      for (float& d : direction) d = signedSize();
    } else if (kind == 3) {
      direction = {0, 0, 0};
    }
    directions.insert(directions.end(), direction.begin(), direction.end());
  }
  return directions;
}

size_t cubeMapNumbers(uint32_t resolution) {
  return size_t{6} * resolution * resolution * 3;
}

}  // namespace

template <>
OperationTests makeTests<CubeMapForward>() {
  OperationTests tests;
  tests.noGradient = "its gradient is CubeMapBackward";
  for (const uint32_t resolution : kCubeMapResolutions)
    for (const Size& size : kSizes)
      tests.cases.push_back({fmt::format("resolution {}, rays {}", resolution, toString(size)), [=](Stage& stage) {
                               CubeMapForward a;
                               a.resolution = resolution;
                               a.rays = stage.count(size);
                               a.directions = stage.input(cubeMapDirections(stage.random, size.capacity));
                               a.texels = stage.randomInput(cubeMapNumbers(resolution), -1, 1);
                               a.colours = stage.output("colours", 3 * size.capacity);
                               stage.device.run(a);
                             }});
  return tests;
}

template <>
OperationTests makeTests<CubeMapBackward>() {
  OperationTests tests;
  for (const uint32_t resolution : kCubeMapResolutions)
    for (const bool opacity : {false, true}) {
      const std::string name = fmt::format("resolution {}{}", resolution, opacity ? ", opacity" : "");
      for (const Size& size : kSizes)
        tests.cases.push_back({fmt::format("{}, rays {}", name, toString(size)), [=](Stage& stage) {
                                 CubeMapBackward a;
                                 a.resolution = resolution;
                                 a.rays = stage.count(size);
                                 a.directions = stage.input(cubeMapDirections(stage.random, size.capacity));
                                 if (opacity) a.opacity = stage.randomInput(size.capacity, 0, 1);
                                 a.rayColourGradients = stage.randomInput(3 * size.capacity, -1, 1);
                                 a.texelGradients = stage.output(
                                     "texelGradients", stage.random.floats(cubeMapNumbers(resolution), -1, 1));
                                 stage.device.run(a);
                               }});
      tests.gradients.push_back(
          {name, [=](Stage& stage) {
             const uint32_t rays = 40;
             const std::vector<float> directions = cubeMapDirections(stage.random, rays);
             const std::vector<float> opacities = stage.random.floats(rays, 0, 1);
             const std::vector<float> upstream = stage.random.floats(3 * rays, -1, 1);
             const std::vector<float> texels = stage.random.floats(cubeMapNumbers(resolution), -1, 1);
             CubeMapBackward a;
             a.resolution = resolution;
             a.rays.capacity = rays;
             a.directions = stage.input(directions);
             if (opacity) a.opacity = stage.input(opacities);
             a.rayColourGradients = stage.input(upstream);
             a.texelGradients = stage.output("texelGradients", std::vector<float>(texels.size()));
             stage.device.run(a);
             const auto loss = [&](View moved) {
               double sum = 0;
               for (size_t ray = 0; ray < rays; ++ray) {
                 const reference::Point colour = reference::cubeMapColour(
                     resolution, moved, {directions[3 * ray], directions[3 * ray + 1], directions[3 * ray + 2]});
                 const double transmittance = opacity ? 1 - opacities[ray] : 1;
                 for (size_t channel = 0; channel < 3; ++channel)
                   sum += transmittance * upstream[3 * ray + channel] * colour[channel];
               }
               return sum;
             };
             return std::vector<GradientPair>{
                 {"texels", stage.device.read(a.texelGradients),
                  centralDifferences(loss, toDoubles(texels), 0.5, firstIndices(texels.size()))}};
           }});
    }
  return tests;
}

}  // namespace tessera::device_test

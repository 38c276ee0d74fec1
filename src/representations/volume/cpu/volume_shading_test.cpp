#include "representations/volume/cpu/volume_shading.h"

#include <gtest/gtest.h>

#include "representations/volume/testing/test_volume_content.h"

namespace tessera {
namespace {

ContentComposite randomComposite(uint64_t seed) {
  const RandomStream random(seed, 1);
  ContentComposite composite;
  for (int k = 0; k < 7; ++k) composite.values[k] = random.uniform(k);
  composite.transmittance = random.uniform(8);
  composite.depth = random.uniform(9);
  return composite;
}

std::array<double, 3> plainNetwork(const std::vector<DenseLayer>& network, std::vector<double> values) {
  for (size_t number = 0; number < network.size(); ++number) {
    const DenseLayer& layer = network[number];
    std::vector<double> next;
    for (uint32_t o = 0; o < layer.outputs; ++o) {
      double sum = layer.biases[o];
      for (uint32_t i = 0; i < layer.inputs; ++i) sum += layer.weights[o * layer.inputs + i] * values[i];
      next.push_back(number + 1 < network.size() ? std::max(0.0, sum) : 1 / (1 + std::exp(-sum)));
    }
    values = next;
  }
  return {values[0], values[1], values[2]};
}

TEST(VolumeShading, EncodesDirectionsAsTheFormatSays) {
  const Vec3d d = Vec3d(0.3, -0.7, 0.5).normalized();
  const std::array<float, 27> encoded = encodeDirection(d);
  for (int c = 0; c < 3; ++c) {
    EXPECT_NEAR(encoded[c], d[c], 1e-6);
    for (int k = 0; k < 4; ++k) {
      EXPECT_NEAR(encoded[3 + 3 * k + c], std::sin((1 << k) * d[c]), 1e-6);
      EXPECT_NEAR(encoded[15 + 3 * k + c], std::cos((1 << k) * d[c]), 1e-6);
    }
  }
}

TEST(VolumeShading, EvaluatesNetworksOfAnyWidths) {
  for (const auto& widths :
       std::vector<std::vector<uint32_t>>{{34, 16, 16, 3}, {34, 5, 3}, {34, 3}, {34, 256, 33, 9, 3}}) {
    const std::vector<DenseLayer> network = randomNetwork(widths.size(), widths);
    const DeferredShader shader(network);
    for (uint64_t seed = 0; seed < 20; ++seed) {
      const ContentComposite composite = randomComposite(seed);
      const std::array<float, 27> direction = encodeDirection(Vec3d(0.1 * seed, -0.4, 0.3).normalized());
      std::vector<double> inputs(composite.values, composite.values + 7);
      inputs.insert(inputs.end(), direction.begin(), direction.end());
      const std::array<double, 3> expected = plainNetwork(network, inputs);
      const std::array<float, 3> actual = shader.shade(composite, direction);
      for (int c = 0; c < 3; ++c) EXPECT_NEAR(actual[c], expected[c], 1e-5);
    }
  }
}

TEST(VolumeShading, BlendsFrontToBackAsBackToFront) {
  const std::array<float, 27> direction = encodeDirection(Vec3d::UnitX());
  std::vector<DeferredShader> shaders;
  std::vector<ContentComposite> composites;
  BlendedRay ray;
  for (uint64_t k = 0; k < 5; ++k) {
    shaders.emplace_back(randomNetwork(k));
    composites.push_back(randomComposite(k));
    ray.add(composites[k], shaders[k], direction);
  }
  double colour[3] = {0, 0, 0}, transmittance = 1;
  for (int k = 4; k >= 0; --k) {
    const std::array<float, 3> specular = shaders[k].shade(composites[k], direction);
    const double opacity = 1 - composites[k].transmittance;
    for (int c = 0; c < 3; ++c) {
      colour[c] = composites[k].values[c] + opacity * specular[c] + (1 - opacity) * colour[c];
    }
    transmittance *= composites[k].transmittance;
  }
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(ray.colour[c], colour[c], 1e-5);
  EXPECT_NEAR(ray.transmittance, transmittance, 1e-6);
}

// City-on-Web, equations 8 to 11: a worked example.
TEST(VolumeShading, BlendsBlocksWithoutNetworksLikeOneVolume) {
  const double alphas[] = {.1, .3, .2, .5, .25}, colours[] = {.9, .2, .5, .7, .1};
  const DeferredShader dark(darkNetwork());
  BlendedRay ray;
  for (const auto& [first, last] : {std::pair(0, 2), std::pair(2, 4), std::pair(4, 5)}) {
    ContentComposite block;
    for (int i = first; i < last; ++i) {
      block.values[0] += static_cast<float>(block.transmittance * alphas[i] * colours[i]);
      block.transmittance *= static_cast<float>(1 - alphas[i]);
    }
    ray.add(block, dark, encodeDirection(Vec3d::UnitX()));
  }
  EXPECT_NEAR(ray.colour[0], 0.3897, 1e-6);
  EXPECT_NEAR(1 - ray.transmittance, 0.811, 1e-6);
}

TEST(VolumeShading, AddsNothingForAContentThatHoldsNothing) {
  const std::array<float, 27> direction = encodeDirection(Vec3d::UnitX());
  const DeferredShader shader(randomNetwork(1));
  BlendedRay ray;
  ray.add(randomComposite(1), shader, direction);
  const BlendedRay before = ray;
  ray.add(ContentComposite{}, shader, direction);
  EXPECT_EQ(ray.colour, before.colour);
  EXPECT_EQ(ray.transmittance, before.transmittance);
  EXPECT_EQ(ray.depth, before.depth);
}

}  // namespace
}  // namespace tessera

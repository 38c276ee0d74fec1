#include "representations/mesh/content/infer_maps.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>

#include "representations/mesh/testing/random_mesh.h"

namespace tessera {
namespace {

using tiles_test::inferredPatchSet;
using tiles_test::randomMeshEncoder;

// An encoder in double precision, as the format defines it.
std::array<double, kMeshFeatures> encode(const MeshEncoder& encoder, const Vec3d& position) {
  const HashGridOptions& grid = encoder.grid;
  std::vector<double> values;
  size_t firstEntry = 0;
  for (int level = 0; level < grid.levels; ++level) {
    const double growth = std::pow(1.0 * grid.finestResolution / grid.baseResolution, level / (grid.levels - 1.0));
    const double scale = grid.baseResolution * growth - 1;
    const uint32_t r = static_cast<uint32_t>(std::ceil(scale - 1e-6)) + 1;
    const uint32_t entries = std::min((r * r * r + 7) / 8 * 8, 1u << grid.log2TableSize);
    std::vector<double> sums(static_cast<size_t>(grid.features));
    const Vec3d q = scale * position + Vec3d::Constant(0.5);
    for (uint32_t corner = 0; corner < 8; ++corner) {
      std::array<uint32_t, 3> at{};
      double weight = 1;
      for (uint32_t axis = 0; axis < 3; ++axis) {
        const double first = std::floor(q[axis]);
        const bool isUpper = (corner >> axis & 1) != 0;
        at[axis] = static_cast<uint32_t>(first) + (isUpper ? 1 : 0);
        weight *= isUpper ? q[axis] - first : 1 - (q[axis] - first);
      }
      const auto [x, y, z] = at;
      const uint32_t entry =
          (r * r * r > entries ? x ^ 2654435761u * y ^ 805459861u * z : x + r * (y + r * z)) % entries;
      for (size_t f = 0; f < sums.size(); ++f)
        sums[f] += weight * fromHalf(encoder.table[(firstEntry + entry) * sums.size() + f]);
    }
    values.insert(values.end(), sums.begin(), sums.end());
    firstEntry += entries;
  }
  size_t next = 0;
  for (uint32_t layer = 0; layer <= encoder.hiddenLayers; ++layer) {
    std::vector<double> outputs(layer == encoder.hiddenLayers ? kMeshFeatures : encoder.width);
    for (double& output : outputs) {
      for (const double value : values) output += fromHalf(encoder.weights[next++]) * value;
      if (layer < encoder.hiddenLayers) output = std::max(0.0, output);
    }
    values = outputs;
  }
  EXPECT_EQ(next, encoder.weights.size());
  std::array<double, kMeshFeatures> features{};
  std::copy(values.begin(), values.end(), features.begin());
  return features;
}

// The nine numbers of a texel before they are rounded, of which the opacity is limited.
std::array<double, 9> computeTexel(const PatchSet& set, const MeshEncoder& encoder, uint32_t patch, uint32_t column,
                                   uint32_t row) {
  const PatchEncoder& from = *set.encoder;
  const uint32_t n = from.places;
  std::array<double, 9> mean{};
  for (uint32_t b = 0; b < n; ++b) {
    for (uint32_t a = 0; a < n; ++a) {
      const double u = (column + (a + 0.5) / n - 0.5) / (set.patchEdge - 1),
                   v = (row + (b + 0.5) / n - 0.5) / (set.patchEdge - 1);
      const auto corner = [&](uint32_t number) { return set.corner(patch, number); };
      Vec3d x = corner(0) + u * (corner(1) - corner(0)) + v * (corner(2) - corner(0));
      if (patch < set.pairs && u + v > 1)
        x = corner(3) + (1 - u) * (corner(2) - corner(3)) + (1 - v) * (corner(1) - corner(3));
      for (int axis = 0; axis < 3; ++axis)
        x[axis] = std::clamp(from.scale[axis] * x[axis] + from.offset[axis], 0.0, 1.0);
      const auto features = encode(encoder, x);
      for (size_t f = 0; f < kMeshFeatures; ++f) mean[f] += features[f] / (n * n);
      mean[8] += 1 / (1 + std::exp(-features[0] - encoder.opacityOffset)) / (n * n);
    }
  }
  return mean;
}

TEST(InferMaps, GivesTheTexelsThatTheFormatDefines) {
  const std::unique_ptr<Device> device = makeDevice({"cpu", 2});
  uint32_t opaque = 0, transparent = 0, between = 0;
  for (const uint32_t places : {1u, 2u, 4u}) {
    PatchSet set = inferredPatchSet(places, places);
    const MeshEncoder encoder = randomMeshEncoder(places);
    MapInference(*device, encoder).infer(set);
    for (uint32_t patch = 0; patch < set.patches; ++patch) {
      const uint32_t left = patch % set.patchesAcross() * set.patchEdge,
                     top = patch / set.patchesAcross() * set.patchEdge;
      for (uint32_t y = 0; y < set.patchEdge; y += 4) {
        for (uint32_t x = 0; x < set.patchEdge; x += 4) {
          std::array<std::array<double, 16>, 9> expected{};
          for (uint32_t i = 0; i < 16; ++i) {
            const auto texel = computeTexel(set, encoder, patch, x + i % 4, y + i / 4);
            for (size_t f = 0; f < kMeshFeatures; ++f) {
              const FeatureRange& range = set.ranges[f];
              expected[f][i] = std::clamp(255 * (texel[f] - range.low) / (range.high - range.low), 0.0, 255.0);
            }
            const double from = double{set.encoder->opaqueFrom}, below = double{set.encoder->transparentBelow};
            const double opacity = texel[8] >= from ? 1 : texel[8] < below ? 0 : texel[8];
            const bool isOnBound = std::abs(texel[8] - from) < 1e-4 || std::abs(texel[8] - below) < 1e-4;
            expected[8][i] = isOnBound ? -1 : 255 * opacity;
            ++(opacity == 1 ? opaque : opacity == 0 ? transparent : between);
          }
          const size_t block = (left + x) / 4 + size_t{set.textureWidth() / 4} * ((top + y) / 4);
          for (uint32_t number = 0; number < 9; ++number) {
            const uint8_t* const bytes = number < 8
                                             ? set.featureBlocks[number / 2].data() + 16 * block + 8 * (number % 2)
                                             : set.opacityBlocks.data() + 8 * block;
            const auto [low, high] = std::minmax_element(expected[number].begin(), expected[number].end());
            if (*low < 0) continue;  // rounding may decide
            for (uint32_t i = 0; i < 16; ++i) {
              // Half of a step of the palette, and of one of the bytes.
              EXPECT_NEAR(decodeBc4Texel(bytes, i), expected[number][i], (*high - *low + 1) / 14 + 0.51)
                  << number << " of texel " << i << " of patch " << patch;
            }
          }
        }
      }
    }
  }
  EXPECT_GT(opaque, 100u);
  EXPECT_GT(transparent, 100u);
  EXPECT_GT(between, 100u);
}

TEST(InferMaps, GivesTheSameBytesWithAnyNumberOfThreads) {
  const MeshEncoder encoder = randomMeshEncoder(7);
  PatchSet one = inferredPatchSet(7, 4), other = one;
  // Enough patches for several batches.
  one.patches = 900;
  one.vertices.resize(size_t{12} * one.patches);
  for (size_t i = 0; i < one.vertices.size(); ++i) one.vertices[i] = static_cast<uint16_t>(i * 7919);
  other = one;
  const std::unique_ptr<Device> single = makeDevice({"cpu", 1}), several = makeDevice({"cpu", 3});
  MapInference(*single, encoder).infer(one);
  MapInference(*several, encoder).infer(other);
  EXPECT_EQ(one.featureBlocks, other.featureBlocks);
  EXPECT_EQ(one.opacityBlocks, other.opacityBlocks);
}

TEST(InferMaps, GivesBytesWhateverTheEncoderComputes) {
  MeshEncoder encoder = randomMeshEncoder(3);
  for (uint16_t& weight : encoder.weights) weight = (weight & 1) ? 0x7bff : 0xfbff;  // the largest numbers
  for (uint16_t& number : encoder.table) number = 0x7bff;
  encoder.hiddenLayers = 16;
  while (encoder.weights.size() < countMultiplyAccumulates(encoder.shape()))
    encoder.weights.push_back(encoder.weights[encoder.weights.size() % 17]);
  ASSERT_EQ(validationError(encoder), std::nullopt);
  PatchSet set = inferredPatchSet(3);
  const std::unique_ptr<Device> device = makeDevice({"cpu", 2});
  MapInference(*device, encoder).infer(set);
  EXPECT_EQ(set.opacityBlocks.size(), 8 * set.textureBlocks());
}

}  // namespace
}  // namespace tessera

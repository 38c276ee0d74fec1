// For tests: small contents of random triangles and texels, stored or inferred.
#pragma once

#include <algorithm>
#include <vector>

#include "base/random.h"
#include "representations/mesh/content/mesh_content.h"
#include "representations/mesh/content/mesh_encoder.h"
#include "tiles/bc4.h"

namespace tessera::tiles_test {

// Returns a random network features and harmonics → 16 → 3.
inline std::vector<DenseLayer> randomMeshNetwork(uint64_t seed) {
  const RandomStream random(seed, 0x6d6e);
  uint64_t next = 0;
  std::vector<DenseLayer> network;
  for (const auto& [inputs, outputs] : {std::pair{kMeshFeatures + kMeshHarmonics, 16u}, {16u, 3u}}) {
    DenseLayer layer{inputs, outputs, {}, {}};
    for (uint32_t i = 0; i < inputs * outputs; ++i) layer.weights.push_back(random.uniform(next++) - 0.5f);
    for (uint32_t i = 0; i < outputs; ++i) layer.biases.push_back(random.uniform(next++) - 0.5f);
    network.push_back(std::move(layer));
  }
  return network;
}

// Returns blocks of random texels. Every other block has its end points swapped and with them the other palette.
inline std::vector<uint8_t> randomBc4Blocks(const RandomStream& random, uint64_t& next, uint64_t count) {
  std::vector<uint8_t> bytes;
  for (uint64_t i = 0; i < count; ++i) {
    Bc4Texels texels;
    for (uint8_t& texel : texels) texel = static_cast<uint8_t>(random.below(next++, 256));
    Bc4Block block = encodeBc4(texels, Bc4Effort::fast);
    if (i % 2 == 1) std::swap(block[0], block[1]);
    bytes.insert(bytes.end(), block.begin(), block.end());
  }
  return bytes;
}

// Returns a part with 3 to 8 patches, at least one of them single and one with two triangles.
inline PatchSet randomPatchSet(uint64_t seed) {
  const RandomStream random(seed, 0x6d65);
  uint64_t next = 0;
  PatchSet set;
  set.patchEdge = random.below(next++, 2) == 0 ? 8 : 12;
  set.patches = 3 + random.below(next++, 6);
  set.pairs = 1 + random.below(next++, set.patches - 1);
  for (double& number : set.origin) number = random.uniformDouble(next++) - 2;
  set.step = (1 + random.uniformDouble(next++)) / 32768;
  for (uint32_t i = 0; i < 12 * set.patches; ++i) {
    set.vertices.push_back(static_cast<uint16_t>(random.below(next++, UINT16_MAX + 1)));
  }
  for (FeatureRange& range : set.ranges) {
    range.low = 2 * random.uniform(next++) - 2;
    range.high = range.low + 3 * random.uniform(next++);
  }
  for (auto& blocks : set.featureBlocks) blocks = randomBc4Blocks(random, next, 2 * set.textureBlocks());
  set.opacityBlocks = randomBc4Blocks(random, next, set.textureBlocks());
  set.decoder = randomMeshNetwork(seed);
  return set;
}

// Returns a random content that satisfies every rule of the format. A background block has a sky.
inline MeshContent randomMeshContent(uint64_t seed, uint32_t parts = 2, bool isBackground = false) {
  MeshContent content;
  content.isBackground = isBackground;
  for (uint32_t i = 0; i < parts; ++i) content.parts.push_back(randomPatchSet(seed + 100 * i));
  if (isBackground) {
    const RandomStream random(seed, 0x736b);
    content.skyEdge = 4;
    content.sky.resize(size_t{18} * content.skyEdge * content.skyEdge);
    for (size_t i = 0; i < content.sky.size(); ++i) content.sky[i] = static_cast<uint8_t>(random.below(i, 256));
  }
  return content;
}

// Returns a random encoder with one dense and two hashed levels.
inline MeshEncoder randomMeshEncoder(uint64_t seed) {
  const RandomStream random(seed, 0x656e);
  uint64_t next = 0;
  MeshEncoder encoder;
  encoder.grid = {3, 2, 7, 4, 23};
  encoder.width = 16;
  encoder.hiddenLayers = 2;
  encoder.opacityOffset = -0.25f;
  encoder.table.resize(HashGrid(encoder.grid).parameters());
  encoder.weights.resize(countMultiplyAccumulates(encoder.shape()));
  for (uint16_t& half : encoder.table) half = toHalf(4 * random.uniform(next++) - 2);
  for (uint16_t& half : encoder.weights) half = toHalf(1.5f * random.uniform(next++) - 0.75f);
  return encoder;
}

// Returns a part whose maps are inferred, with the numbers of randomPatchSet(seed). The triangles fill most of the unit
// cube of the encoder.
inline PatchSet inferredPatchSet(uint64_t seed, uint32_t places = 1) {
  PatchSet set = randomPatchSet(seed);
  PatchEncoder& encoder = set.encoder.emplace();
  for (size_t axis = 0; axis < 3; ++axis) {
    encoder.scale[axis] = 1.1 / (65535 * set.step);
    encoder.offset[axis] = -0.05 - encoder.scale[axis] * set.origin[axis];
  }
  encoder.places = places;
  encoder.opaqueFrom = 0.6f;
  encoder.transparentBelow = 0.4f;
  for (auto& blocks : set.featureBlocks) blocks.clear();
  set.opacityBlocks.clear();
  return set;
}

// Returns a content of two parts, of which one has an encoder.
inline MeshContent inferredMeshContent(uint64_t seed) {
  MeshContent content = randomMeshContent(seed, 1);
  content.parts.push_back(inferredPatchSet(seed + 1, 2));
  content.encoders = {std::make_shared<SharedEncoder>(randomMeshEncoder(seed))};
  return content;
}

}  // namespace tessera::tiles_test

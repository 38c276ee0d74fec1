#include "representations/mesh/vulkan/gpu_mesh_content.h"

#include <algorithm>

#include "base/check.h"
#include "shaders/representations/mesh/arguments_mesh.h"

namespace tessera {
namespace {

static_assert(kMeshFeatures == TESSERA_MESH_FEATURES);

// The addresses are offsets in `packed`.
arguments::MeshPartArguments packPart(const PatchSet& part, PackedContent& packed, uint32_t& maxWidth) {
  const bool hasMaps = !part.opacityBlocks.empty();
  CHECK((hasMaps || part.encoder.has_value()));
  arguments::MeshPartArguments packedPart = {};
  packedPart.vertices = packed.add(part.vertices);
  const std::vector<uint8_t> none(hasMaps ? 0 : PatchSet::kBc5Bytes * part.textureBlocks());
  for (uint32_t texture = 0; texture < PatchSet::kFeatureTextures; ++texture)
    packedPart.features[texture] = packed.add(hasMaps ? part.featureBlocks[texture] : none);
  packedPart.opacities =
      packed.add(hasMaps ? part.opacityBlocks : std::vector<uint8_t>(PatchSet::kBc4Bytes * part.textureBlocks()));
  const GpuNetwork network = addNetwork(part.decoder, packed);
  packedPart.layers = network.layers;
  packedPart.weights = network.weights;
  packedPart.layerCount = network.layerCount;
  maxWidth = std::max(maxWidth, network.maxWidth);
  for (uint32_t f = 0; f < kMeshFeatures; ++f) {
    packedPart.low[f] = part.ranges[f].low;
    packedPart.span[f] = part.ranges[f].high - part.ranges[f].low;
  }
  packedPart.patchEdge = part.patchEdge;
  packedPart.patchesAcross = part.patchesAcross();
  packedPart.pairs = part.pairs;
  return packedPart;
}

}  // namespace

GpuMeshContent::GpuMeshContent(const std::shared_ptr<GpuStream>& stream, const MeshContent& content)
    : skyEdge(content.skyEdge) {
  PackedContent packed;
  std::vector<arguments::MeshPartArguments> all;
  for (const PatchSet& part : content.parts) {
    if (part.patches == 0) continue;
    parts.push_back({0, part.origin, part.step, part.triangles()});
    all.push_back(packPart(part, packed, maxWidth));
  }
  const size_t firstPart = packed.add(all), skyBytes = packed.add(content.sky);
  if (packed.bytes().empty()) return;
  memory = GpuContentMemory(stream, packed.bytes().size());
  const uint64_t base = memory.address();
  for (size_t number = 0; number < all.size(); ++number) {
    arguments::MeshPartArguments& part = all[number];
    for (uint64_t* at : {&part.vertices, &part.opacities, &part.layers, &part.weights}) *at += base;
    for (uint64_t& texture : part.features) texture += base;
    parts[number].address = base + firstPart + number * sizeof(part);
  }
  packed.replace(firstPart, all);
  memory.upload(packed);
  if (skyEdge > 0) sky = base + skyBytes;
}

}  // namespace tessera

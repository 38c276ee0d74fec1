#include "representations/mesh/content/mesh_content.h"

#include <algorithm>
#include <cmath>

#include "base/check.h"
#include "tiles/bc4.h"

namespace tessera {
namespace {

// What is mixed of a texture at one place: the bytes of four blocks, or fewer, and the texels in them.
struct Footprint {
  struct Texel {
    size_t block;    // number in the texture
    uint32_t texel;  // number in the block
    float weight;
  };
  std::array<Texel, 4> texels;

  // `offset`: of the block within `stride` bytes.
  float mix(const std::vector<uint8_t>& blocks, size_t stride, size_t offset) const {
    float sum = 0;
    for (const Texel& texel : texels)
      sum += texel.weight * decodeBc4Texel(blocks.data() + stride * texel.block + offset, texel.texel);
    return sum;
  }
};

Footprint makeFootprint(const PatchSet& set, uint32_t patch, float column, float row) {
  const uint32_t edge = set.patchEdge, across = set.patchesAcross(), blocksAcross = set.textureWidth() / 4;
  const auto clampCell = [&](float at) { return std::min(static_cast<uint32_t>(std::max(0.0f, at)), edge - 2); };
  const uint32_t x = clampCell(column), y = clampCell(row);
  const float right = std::clamp(column - static_cast<float>(x), 0.0f, 1.0f);
  const float lower = std::clamp(row - static_cast<float>(y), 0.0f, 1.0f);
  const uint32_t left = edge * (patch % across) + x, top = edge * (patch / across) + y;
  Footprint footprint{};
  for (uint32_t corner = 0; corner < 4; ++corner) {
    const uint32_t dx = corner & 1, dy = corner >> 1;
    footprint.texels[corner] = {(left + dx) / 4 + size_t{blocksAcross} * ((top + dy) / 4),
                                (left + dx) % 4 + 4 * ((top + dy) % 4),
                                (dx ? right : 1 - right) * (dy ? lower : 1 - lower)};
  }
  return footprint;
}

}  // namespace

uint8_t FeatureRange::encode(float value) const {
  if (!(high > low)) return 0;
  // std::max returns 0 for what is not a number.
  return static_cast<uint8_t>(std::min(std::max(0.0f, (value - low) / (high - low) * 255 + 0.5f), 255.0f));
}

uint32_t PatchSet::patchesAcross() const {
  uint32_t across = static_cast<uint32_t>(std::sqrt(static_cast<double>(patches)));
  while (uint64_t{across} * across < patches) ++across;
  return across;
}

uint32_t PatchSet::textureHeight() const {
  const uint32_t across = std::max(1u, patchesAcross());
  return (patches + across - 1) / across * patchEdge;
}

Vec3d PatchSet::corner(uint32_t patch, uint32_t number) const {
  const uint16_t* const v = vertices.data() + size_t{12} * patch + size_t{3} * number;
  return {origin[0] + step * v[0], origin[1] + step * v[1], origin[2] + step * v[2]};
}

MeshTexel mixTexels(const PatchSet& set, uint32_t patch, float column, float row) {
  const Footprint footprint = makeFootprint(set, patch, column, row);
  MeshTexel mixed;
  for (uint32_t f = 0; f < kMeshFeatures; ++f) {
    mixed.features[f] =
        set.ranges[f].decode(footprint.mix(set.featureBlocks[f / 2], PatchSet::kBc5Bytes, f % 2 * PatchSet::kBc4Bytes));
  }
  mixed.opacity = footprint.mix(set.opacityBlocks, PatchSet::kBc4Bytes, 0) / 255;
  return mixed;
}

uint64_t MeshContent::triangles() const {
  uint64_t sum = 0;
  for (const PatchSet& part : parts) sum += part.triangles();
  return sum;
}

std::array<float, 3> skyColour(const MeshContent& content, const Vec3d& direction) {
  const uint32_t edge = content.skyEdge;
  CHECK(edge >= 2u);
  int axis = 0;
  const double length = direction.cwiseAbs().maxCoeff(&axis);
  const auto place = [&](int other) { return std::clamp((direction[other] / length + 1) / 2, 0.0, 1.0) * (edge - 1); };
  const double column = place((axis + 1) % 3), row = place((axis + 2) % 3);
  const uint32_t x = std::min(static_cast<uint32_t>(column), edge - 2),
                 y = std::min(static_cast<uint32_t>(row), edge - 2);
  const uint32_t side = static_cast<uint32_t>(2 * axis) + (direction[axis] < 0 ? 1 : 0);
  std::array<float, 3> colour{};
  for (uint32_t corner = 0; corner < 4; ++corner) {
    const uint32_t dx = corner & 1, dy = corner >> 1;
    const double weight = (dx ? column - x : 1 - (column - x)) * (dy ? row - y : 1 - (row - y));
    const size_t texel = (size_t{side} * edge + y + dy) * edge + x + dx;
    for (size_t c = 0; c < 3; ++c) colour[c] += static_cast<float>(weight * content.sky[3 * texel + c] / 255);
  }
  return colour;
}

uint64_t patchSetBytes(const PatchSet& set) {
  uint64_t bytes = sizeof(PatchSet) + uint64_t{24} * set.patches +
                   set.textureBlocks() * (4 * PatchSet::kBc5Bytes + PatchSet::kBc4Bytes);
  for (const DenseLayer& layer : set.decoder)
    bytes += sizeof(DenseLayer) + sizeof(float) * ((layer.outputs + 7) / 8 * 8) * (uint64_t{layer.inputs} + 1);
  return bytes;
}

uint64_t bytesInMemory(const MeshContent& content) {
  uint64_t bytes = sizeof(MeshContent) + uint64_t{18} * content.skyEdge * content.skyEdge;
  for (const PatchSet& part : content.parts) bytes += patchSetBytes(part);
  return bytes;
}

}  // namespace tessera

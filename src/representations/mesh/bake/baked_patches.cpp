#include "representations/mesh/bake/baked_patches.h"

#include <algorithm>
#include <cmath>

#include "base/check.h"

namespace tessera {
namespace {

constexpr double kMaxSteps = 65535;

// Sets origin, step and vertices of a set from corners in the scene, [patches][4].
void quantiseVertices(const std::vector<Vec3d>& corners, PatchSet& set) {
  Vec3d low = Vec3d::Constant(INFINITY), high = Vec3d::Constant(-INFINITY);
  for (const Vec3d& corner : corners) {
    low = low.cwiseMin(corner);
    high = high.cwiseMax(corner);
  }
  if (corners.empty()) low = high = Vec3d::Zero();
  // One step is left on both sides, because the origin is rounded, too.
  const double extent = std::max(1e-3, (high - low).maxCoeff());
  set.step = std::exp2(std::ceil(std::log2(extent / (kMaxSteps - 2))));
  for (int axis = 0; axis < 3; ++axis) set.origin[axis] = std::floor(low[axis] / set.step) * set.step;
  for (const Vec3d& corner : corners)
    for (int axis = 0; axis < 3; ++axis)
      set.vertices.push_back(static_cast<uint16_t>(std::lround((corner[axis] - set.origin[axis]) / set.step)));
}

}  // namespace

Vec3d BakedPatches::corner(uint32_t patch, uint32_t number) const {
  const double* const x = vertices.data() + size_t{12} * patch + size_t{3} * number;
  return {x[0], x[1], x[2]};
}

Vec3d BakedPatches::centre(uint32_t patch) const {
  Vec3d sum = corner(patch, 0) + corner(patch, 1) + corner(patch, 2);
  if (patch >= pairs) return sum / 3;
  return (sum + corner(patch, 3)) / 4;
}

Vec3d BakedPatches::direction(uint32_t patch) const {
  const float* const x = directions.data() + size_t{3} * patch;
  return {x[0], x[1], x[2]};
}

MeshTexel mixTexels(const BakedPatches& patches, uint32_t patch, float column, float row) {
  constexpr uint32_t kNumbers = BakedPatches::kNumbers;
  const uint32_t edge = patches.patchEdge;
  const auto clampCell = [&](float at) { return std::min(static_cast<uint32_t>(std::max(0.0f, at)), edge - 2); };
  const uint32_t x = clampCell(column), y = clampCell(row);
  const float right = std::clamp(column - static_cast<float>(x), 0.0f, 1.0f);
  const float lower = std::clamp(row - static_cast<float>(y), 0.0f, 1.0f);
  const uint8_t* const texels = patches.texels.data() + size_t{kNumbers} * edge * edge * patch;
  std::array<float, kNumbers> bytes{};
  for (uint32_t corner = 0; corner < 4; ++corner) {
    const uint32_t dx = corner & 1, dy = corner >> 1;
    const float weight = (dx ? right : 1 - right) * (dy ? lower : 1 - lower);
    const uint8_t* const texel = texels + size_t{kNumbers} * (x + dx + edge * (y + dy));
    for (uint32_t i = 0; i < kNumbers; ++i) bytes[i] += weight * texel[i];
  }
  MeshTexel mixed;
  for (uint32_t f = 0; f < kMeshFeatures; ++f) mixed.features[f] = patches.ranges[f].decode(bytes[f]);
  mixed.opacity = bytes[kMeshFeatures] / 255;
  return mixed;
}

void passThroughBc4(BakedPatches& patches, Bc4Effort effort) {
  constexpr uint32_t kNumbers = BakedPatches::kNumbers;
  const uint32_t edge = patches.patchEdge;
  CHECK(edge % 4 == 0u);
  for (uint32_t patch = 0; patch < patches.patches(); ++patch) {
    uint8_t* const texels = patches.texels.data() + size_t{kNumbers} * edge * edge * patch;
    for (uint32_t number = 0; number < kNumbers; ++number) {
      for (uint32_t y = 0; y < edge; y += 4) {
        for (uint32_t x = 0; x < edge; x += 4) {
          const auto texel = [&](uint32_t i) -> uint8_t& {
            return texels[size_t{kNumbers} * (x + i % 4 + edge * (y + i / 4)) + number];
          };
          Bc4Texels block{};
          for (uint32_t i = 0; i < block.size(); ++i) block[i] = texel(i);
          const std::array<float, 16> decoded = decodeBc4(encodeBc4(block, effort));
          for (uint32_t i = 0; i < block.size(); ++i) texel(i) = static_cast<uint8_t>(decoded[i] + 0.5f);
        }
      }
    }
  }
}

PatchSet arrangePatches(const BakedPatches& patches, std::span<const uint32_t> numbers,
                        const SceneFromPart& sceneFromPart) {
  PatchSet set;
  set.patchEdge = patches.patchEdge;
  set.patches = static_cast<uint32_t>(numbers.size());
  CHECK(set.patches <= maxPatches(set.patchEdge));
  set.ranges = patches.ranges;
  set.decoder = patches.decoder;
  std::vector<Vec3d> corners;
  for (const uint32_t number : numbers) {
    const bool isPair = number < patches.pairs;
    CHECK((!isPair || set.pairs == corners.size() / 4) == true);
    set.pairs += isPair ? 1 : 0;
    for (uint32_t c = 0; c < 4; ++c) corners.push_back(sceneFromPart * patches.corner(number, c < 3 || isPair ? c : 0));
  }
  quantiseVertices(corners, set);
  return set;
}

PatchSet compressPatches(const BakedPatches& patches, std::span<const uint32_t> numbers,
                         const SceneFromPart& sceneFromPart, Bc4Effort effort) {
  PatchSet set = arrangePatches(patches, numbers, sceneFromPart);
  allocateTextures(set);
  for (uint32_t patch = 0; patch < set.patches; ++patch) {
    const size_t first = size_t{BakedPatches::kNumbers} * set.patchEdge * set.patchEdge * numbers[patch];
    compressPatch(set, patch, patches.texels.data() + first, effort);
  }
  return set;
}

ImageU8 makeBaseColourTexture(const BakedPatches& patches, std::span<const uint32_t> numbers, const PatchSet& set) {
  const uint32_t edge = set.patchEdge, across = set.patchesAcross();
  ImageU8 texture(static_cast<int>(set.textureWidth()), static_cast<int>(set.textureHeight()), 4);
  for (uint32_t patch = 0; patch < set.patches; ++patch) {
    for (uint32_t texel = 0; texel < edge * edge; ++texel) {
      uint8_t* const to = texture.at(static_cast<int>(patch % across * edge + texel % edge),
                                     static_cast<int>(patch / across * edge + texel / edge));
      const size_t from = size_t{numbers[patch]} * edge * edge + texel;
      std::copy_n(patches.baseColours.data() + 3 * from, 3, to);
      to[3] = patches.texels[from * BakedPatches::kNumbers + kMeshFeatures];
    }
  }
  return texture;
}

}  // namespace tessera

#include "representations/mesh/train/texel_atlas.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/error.h"
#include "base/memory.h"
#include "compute/patches.h"
#include "representations/mesh/content/patch_texels.h"

namespace tessera {
namespace {

constexpr uint32_t kTexelsAtATime = 1 << 16;

// The number of the permutation that maps the vertices of a triangle to three corners of its patch.
uint32_t permutationTo(const std::array<uint32_t, 3>& corners, const std::array<uint32_t, 3>& vertices) {
  std::array<uint32_t, 3> permutation{};
  for (uint32_t i = 0; i < 3; ++i)
    permutation[i] = static_cast<uint32_t>(std::find(corners.begin(), corners.end(), vertices[i]) - corners.begin());
  return patchPermutationNumber(permutation);
}

// The last homogeneous coordinate of a point's position in the scene, from its position in the grid.
float sceneFactor(const OctahedraGrid& grid, const Vec3d& point) {
  const float* const m = grid.gridFromScene.data() + 12;
  return static_cast<float>(1 / (m[0] * point.x() + m[1] * point.y() + m[2] * point.z() + m[3]));
}

// Throws Error if a part has more texels than can be numbered, or than fit the memory.
void requireRoom(double texels, uint32_t patchEdge) {
  constexpr double kMaxTexels = 1u << 31, kBytesPerTexel = 48;  // positions here and on the device, ranks and marks
  if (texels < kMaxTexels && texels * kBytesPerTexel < static_cast<double>(usableMemoryBytes())) return;
  throw Error(fmt::format("--set patch_texels={}", patchEdge), "",
              fmt::format("a part has {:.0f} million texels, more than fit the memory", texels / 1e6),
              "train into another folder with a lower number, a lower --set mesh_cells, or more --blocks");
}

}  // namespace

TexelAtlas::TexelAtlas(MeshModel& model, uint32_t level, const FaceSet& faces, uint32_t patchEdge)
    : patchEdge_(patchEdge) {
  const OctahedraDomain& domain = model.level(level).domain();
  const std::vector<float> displacements = model.device().read(model.level(level).displacements().values.all());
  const TriangleList own = listTriangles(domain.grids, domain.ownGrids, displacements, faces.bits());
  FaceSet others(domain.grids);
  for (const uint32_t face : faces.numbers()) others.add(face);
  for (const uint32_t face : own.faceOfTriangle) others.remove(face);
  std::vector<uint32_t> patchOfFace(faceWords(domain.grids) * size_t{32}, kNoPatch);
  std::vector<float> factors, positions;
  // Those that the part owns come first, and share no patch with the others, because contents hold them alone.
  for (const TriangleList& list : {own, listTriangles(domain.grids, domain.grids, displacements, others.bits())}) {
    const std::vector<TrianglePatch> patches = pairTriangles(list);
    const size_t texels = texels_ + patches.size() * patchEdge * patchEdge;
    requireRoom(static_cast<double>(texels), patchEdge);
    positions.reserve(size_t{3} * texels);
    for (const TrianglePatch& patch : patches) addPatch(domain, list, patch, patchOfFace, factors, positions);
  }
  if (factors.empty()) {  // nothing on a device is empty
    factors.resize(4, 1);
    positions.resize(3);
  }
  Device& device = model.device();
  patchOfFace_ = device.uploadArray(patchOfFace);
  cornerFactors_ = device.uploadArray(factors);
  positions_ = device.uploadArray(positions);
}

void TexelAtlas::addPatch(const OctahedraDomain& domain, const TriangleList& list, const TrianglePatch& patch,
                          std::vector<uint32_t>& patchOfFace, std::vector<float>& factors,
                          std::vector<float>& positions) {
  const uint32_t number = static_cast<uint32_t>(factors.size() / 4);
  const auto& c = patch.corners;
  patchOfFace[list.faceOfTriangle[patch.triangles[0]]] =
      16 * number + permutationTo({c[0], c[1], c[2]}, list.triangles[patch.triangles[0]]);
  if (patch.isPair) {
    patchOfFace[list.faceOfTriangle[patch.triangles[1]]] =
        16 * number + kSecondTriangle + permutationTo({c[3], c[2], c[1]}, list.triangles[patch.triangles[1]]);
  }
  std::array<Vec3d, 4> corners;
  for (int corner = 0; corner < 4; ++corner) {
    corners[corner] = list.vertices[c[corner]];
    factors.push_back(sceneFactor(domain.grids[patch.grid], corners[corner]));
  }
  pairs_.push_back(patch.isPair);
  for (uint32_t texel = 0; texel < patchEdge_ * patchEdge_; ++texel) {
    std::array<float, 3> position{};
    toFieldPosition(domain.grids[patch.grid],
                    texelPosition(corners, patch.isPair, texel % patchEdge_, texel / patchEdge_, patchEdge_),
                    position.data());
    positions.insert(positions.end(), position.begin(), position.end());
  }
  texels_ += patchEdge_ * patchEdge_;
}

void TexelAtlas::forEachOutput(MeshModel& model,
                               const std::function<void(uint32_t, const std::vector<float>&)>& use) const {
  constexpr uint32_t kFeatures = MeshField::kFeatures;
  Device& device = model.device();
  model.field().reserve(kTexelsAtATime);
  Array<float> features = device.array<float>(size_t{kFeatures} * kTexelsAtATime);
  for (uint32_t first = 0; first < texels_; first += kTexelsAtATime) {
    const uint32_t count = std::min(kTexelsAtATime, texels_ - first);
    model.field().encode({count}, positions_.part(size_t{3} * first, size_t{3} * count),
                         Matrix<float>(features, kFeatures));
    use(first, device.read(features.part(0, size_t{kFeatures} * count)));
  }
}

std::vector<float> TexelAtlas::encodeTexels(MeshModel& model) const {
  std::vector<float> all;
  forEachOutput(model,
                [&](uint32_t, const std::vector<float>& some) { all.insert(all.end(), some.begin(), some.end()); });
  return all;
}

std::vector<float> TexelAtlas::findRanges(MeshModel& model) const {
  constexpr uint32_t kFeatures = MeshField::kFeatures;
  std::vector<float> ranges;
  for (uint32_t f = 0; f < kFeatures; ++f) {
    ranges.push_back(std::numeric_limits<float>::infinity());
    ranges.push_back(-std::numeric_limits<float>::infinity());
  }
  forEachOutput(model, [&](uint32_t first, const std::vector<float>& some) {
    for (size_t texel = 0; texel < some.size() / kFeatures; ++texel) {
      const uint32_t number = first + static_cast<uint32_t>(texel), within = number % (patchEdge_ * patchEdge_);
      if (!isTexelUsed(pairs_[number / (patchEdge_ * patchEdge_)], within % patchEdge_, within / patchEdge_,
                       patchEdge_))
        continue;
      if (1 / (1 + std::exp(-some[kFeatures * texel] - model.opacityOffset())) < StoredOpacity::kTransparentBelow)
        continue;
      for (size_t f = 0; f < kFeatures; ++f) {
        ranges[2 * f] = std::min(ranges[2 * f], some[kFeatures * texel + f]);
        ranges[2 * f + 1] = std::max(ranges[2 * f + 1], some[kFeatures * texel + f]);
      }
    }
  });
  for (uint32_t f = 0; f < kFeatures; ++f)
    if (!(ranges[2 * f] <= ranges[2 * f + 1])) ranges[2 * f] = ranges[2 * f + 1] = 0;
  return ranges;
}

}  // namespace tessera

#include "representations/mesh/bake/bake_mesh.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "representations/mesh/bake/mesh_patches.h"

namespace tessera {
namespace {

constexpr uint32_t kTexelsAtATime = 1 << 16;

// The decoder's weights without padding.
std::vector<DenseLayer> readDecoder(MeshModel& model) {
  const MlpShape& shape = model.field().shape().decoder;
  const std::vector<float> weights = model.device().read(model.field().decoder().values.all());
  std::vector<DenseLayer> layers;
  for (int l = 0; l < shape.layers(); ++l) {
    DenseLayer layer;
    layer.inputs = static_cast<uint32_t>(l == 0 ? shape.inputs : shape.width);
    layer.outputs = static_cast<uint32_t>(l == shape.hiddenLayers ? shape.outputs : shape.width);
    for (uint32_t o = 0; o < layer.outputs; ++o)
      for (uint32_t i = 0; i < layer.inputs; ++i)
        layer.weights.push_back(weights[shape.weightOffset(l) + size_t{o} * shape.layerInputs(l) + i]);
    layers.push_back(layer);
  }
  return layers;
}

// Writes the position in the field of a point of the scene.
void toFieldPosition(const OctahedraGrid& grid, const Vec3d& point, float* position) {
  double g[4];
  for (size_t row = 0; row < 4; ++row) {
    const float* const m = grid.gridFromScene.data() + 4 * row;
    g[row] = double{m[0]} * point.x() + double{m[1]} * point.y() + double{m[2]} * point.z() + m[3];
  }
  for (int axis = 0; axis < 3; ++axis) {
    const double at = (g[axis] / g[3] + grid.positionOffset[axis]) * grid.positionScale();
    position[axis] = static_cast<float>(std::clamp(at, 0.0, 1.0));
  }
}

}  // namespace

MeshContent bakeMeshContent(MeshModel& model, uint32_t level, const FaceSet& faces, const MeshBakeSettings& settings) {
  const OctahedraDomain& domain = model.level(level).domain();
  Device& device = model.device();
  const TriangleList list = listTriangles(domain.grids, domain.ownGrids,
                                          device.read(model.level(level).displacements().values.all()), faces.bits());
  const std::vector<TrianglePatch> patches = pairTriangles(list);
  MeshContent content;
  content.patchEdge = settings.patchEdge;
  content.decoder = readDecoder(model);
  const size_t texelsPerPatch = size_t{settings.patchEdge} * settings.patchEdge;
  const size_t texels = texelsPerPatch * patches.size();
  for (const TrianglePatch& patch : patches) {
    content.pairs += patch.isPair ? 1 : 0;
    for (const uint32_t corner : patch.corners)
      for (int axis = 0; axis < 3; ++axis) content.vertices.push_back(static_cast<float>(list.vertices[corner][axis]));
  }

  // The output of the encoder at all texels.
  std::vector<float> features;
  features.reserve(texels * kMeshFeatures);
  model.field().reserve(kTexelsAtATime);
  Array<float> positions = device.array<float>(size_t{3} * kTexelsAtATime),
               encoded = device.array<float>(size_t{kMeshFeatures} * kTexelsAtATime);
  std::vector<float> chunk(size_t{3} * kTexelsAtATime);
  for (size_t first = 0; first < texels; first += kTexelsAtATime) {
    const uint32_t count = static_cast<uint32_t>(std::min<size_t>(kTexelsAtATime, texels - first));
    for (uint32_t i = 0; i < count; ++i) {
      const TrianglePatch& patch = patches[(first + i) / texelsPerPatch];
      const uint32_t texel = static_cast<uint32_t>((first + i) % texelsPerPatch);
      std::array<Vec3d, 4> corners;
      for (int corner = 0; corner < 4; ++corner) corners[corner] = list.vertices[patch.corners[corner]];
      const Vec3d at = texelPosition(corners, patch.isPair, texel % settings.patchEdge, texel / settings.patchEdge,
                                     settings.patchEdge);
      toFieldPosition(domain.grids[patch.grid], at, &chunk[size_t{3} * i]);
    }
    device.write(positions.all(), std::span<const float>(chunk));
    model.field().encode({count}, positions, Matrix<float>(encoded, kMeshFeatures));
    const std::vector<float> some = device.read(encoded.part(0, size_t{kMeshFeatures} * count));
    features.insert(features.end(), some.begin(), some.end());
  }

  // Ranges of the features where anything is visible.
  std::vector<float> opacities(texels);
  for (auto& range : content.ranges) {
    range.low = std::numeric_limits<float>::infinity();
    range.high = -range.low;
  }
  for (size_t texel = 0; texel < texels; ++texel) {
    float opacity = 1 / (1 + std::exp(-features[kMeshFeatures * texel] - model.opacityOffset()));
    if (opacity >= settings.opaqueFrom) opacity = 1;
    if (opacity < settings.transparentBelow) opacity = 0;
    opacities[texel] = opacity;
    if (opacity == 0) continue;
    for (uint32_t f = 0; f < kMeshFeatures; ++f) {
      content.ranges[f].low = std::min(content.ranges[f].low, features[kMeshFeatures * texel + f]);
      content.ranges[f].high = std::max(content.ranges[f].high, features[kMeshFeatures * texel + f]);
    }
  }
  for (auto& range : content.ranges)
    if (!(range.low <= range.high)) range = {0, 0};
  content.texels.resize(texels * kMeshNumbers);
  for (size_t texel = 0; texel < texels; ++texel) {
    for (uint32_t f = 0; f < kMeshFeatures; ++f)
      content.texels[kMeshNumbers * texel + f] = content.ranges[f].encode(features[kMeshFeatures * texel + f]);
    content.texels[kMeshNumbers * texel + kMeshFeatures] = FeatureRange{0, 1}.encode(opacities[texel]);
  }
  return content;
}

}  // namespace tessera

#include "representations/mesh/bake/bake_mesh.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <numeric>

#include "base/error.h"
#include "compute/rows.h"
#include "representations/mesh/content/mesh_payload.h"
#include "representations/mesh/train/mesh_patches.h"

namespace tessera {
namespace {

constexpr uint32_t kPlacesAtATime = 1 << 16;

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
    layer.biases.assign(layer.outputs, 0);
    layers.push_back(layer);
  }
  return layers;
}

// The mean directions in which rays see patches, [patches][3]: from above if no ray does.
std::vector<float> averageDirections(const TriangleList& list, const std::vector<TrianglePatch>& patches,
                                     const FaceSet& faces) {
  std::vector<float> directions;
  for (const TrianglePatch& patch : patches) {
    Vec3f sum = faces.direction(list.faceOfTriangle[patch.triangles[0]]);
    if (patch.isPair) sum += faces.direction(list.faceOfTriangle[patch.triangles[1]]);
    const Vec3f direction = sum.isZero() ? Vec3f(-Vec3f::UnitZ()) : Vec3f(sum.normalized());
    directions.insert(directions.end(), direction.begin(), direction.end());
  }
  return directions;
}

// What the field says about a texel.
struct FieldTexel : MeshTexel {
  std::array<float, 3> colour{};
};

// Evaluates the field of a model at the texels of patches.
class TexelField {
 public:
  TexelField(MeshModel& model, uint32_t level, const TriangleList& list, const std::vector<TrianglePatch>& patches,
             const std::vector<float>& directions, const MeshBakeSettings& settings)
      : model_(model),
        domain_(model.level(level).domain()),
        list_(list),
        patches_(patches),
        settings_(settings),
        placesPerEdge_(settings.placesPerEdge > 0 ? settings.placesPerEdge : placesPerEdge(level)) {
    Device& device = model.device();
    if (const CoarseAtlas* const fitted = model.coarseAtlas(level)) {
      placesPerEdge_ = 1;
      fitted_ = device.read(
          fitted->texels.values.part(0, patches.size() * settings.patchEdge * settings.patchEdge * kMeshFeatures));
    }
    model.field().reserve(kPlacesAtATime);
    positions_ = device.array<float>(size_t{3} * kPlacesAtATime);
    encoded_ = device.array<float>(size_t{kMeshFeatures} * kPlacesAtATime);
    if (!settings.baseColours) return;
    patchOfPlace_ = device.array<uint32_t>(kPlacesAtATime);
    std::vector<uint32_t> all(kPlacesAtATime);
    std::iota(all.begin(), all.end(), 0);
    everyPlace_ = device.uploadArray(all);
    directions_ = device.uploadArray(directions.empty() ? std::vector<float>(3) : directions);
  }

  // Calls use(texel, what the field says) for all texels, [patches][T][T], in order.
  void forEachTexel(bool withColours, const std::function<void(size_t, const FieldTexel&)>& use) {
    const uint32_t places = placesPerEdge_ * placesPerEdge_, texelsAtATime = kPlacesAtATime / places;
    const size_t texels = patches_.size() * settings_.patchEdge * settings_.patchEdge;
    for (size_t first = 0; first < texels; first += texelsAtATime) {
      const uint32_t count = static_cast<uint32_t>(std::min<size_t>(texelsAtATime, texels - first));
      const std::vector<float> features = evaluate(first, count * places);
      const std::vector<float> colours = withColours ? evaluateColours(count * places) : std::vector<float>();
      for (uint32_t i = 0; i < count; ++i) use(first + i, mean(features, colours, i * places, places));
    }
  }

 private:
  std::vector<float> evaluate(size_t firstTexel, uint32_t places) {
    if (!fitted_.empty()) {
      const auto begin = fitted_.begin() + static_cast<ptrdiff_t>(kMeshFeatures * firstTexel);
      const std::vector<float> features(begin, begin + ptrdiff_t{kMeshFeatures} * places);
      model_.device().write(encoded_.all(), std::span<const float>(features));
      for (uint32_t i = 0; i < places; ++i)
        patchOfPlaces_[i] = static_cast<uint32_t>((firstTexel + i) / (settings_.patchEdge * settings_.patchEdge));
      return features;
    }
    std::vector<float> positions(size_t{3} * kPlacesAtATime);
    const uint32_t edge = settings_.patchEdge, perTexel = placesPerEdge_ * placesPerEdge_;
    for (uint32_t i = 0; i < places; ++i) {
      const size_t texel = firstTexel + i / perTexel;
      const uint32_t number = static_cast<uint32_t>(texel / (size_t{edge} * edge)),
                     within = static_cast<uint32_t>(texel % (size_t{edge} * edge)), place = i % perTexel;
      const TrianglePatch& patch = patches_[number];
      const auto shifted = [&](uint32_t at, uint32_t part) { return placeInTexel(at, part, placesPerEdge_); };
      std::array<Vec3d, 4> corners;
      for (int corner = 0; corner < 4; ++corner) corners[corner] = list_.vertices[patch.corners[corner]];
      const Vec3d at = texelPosition(corners, patch.isPair, shifted(within % edge, place % placesPerEdge_),
                                     shifted(within / edge, place / placesPerEdge_), edge);
      toFieldPosition(domain_.grids[patch.grid], at, &positions[size_t{3} * i]);
      patchOfPlaces_[i] = number;
    }
    Device& device = model_.device();
    device.write(positions_.all(), std::span<const float>(positions));
    model_.field().encode({places}, positions_, Matrix<float>(encoded_, kMeshFeatures));
    return device.read(encoded_.part(0, size_t{kMeshFeatures} * places));
  }

  // Of the places of the last call of evaluate().
  std::vector<float> evaluateColours(uint32_t places) {
    Device& device = model_.device();
    device.write(patchOfPlace_.all(), std::span<const uint32_t>(patchOfPlaces_));
    device.run(GatherRows{
        {places}, everyPlace_, Matrix<const float>(encoded_, kMeshFeatures), model_.field().decoderFeatures()});
    const Matrix<const float> output = model_.field().decode({places}, directions_, patchOfPlace_);
    std::vector<float> colours(size_t{3} * places);
    const std::vector<float> all = device.read(output.data);
    for (size_t i = 0; i < places; ++i)
      for (size_t c = 0; c < 3; ++c) colours[3 * i + c] = all[output.rowStride * i + c];
    return colours;
  }

  FieldTexel mean(const std::vector<float>& features, const std::vector<float>& colours, uint32_t first,
                  uint32_t places) const {
    FieldTexel texel{averagePlaces(std::span(features).subspan(kMeshFeatures * first, kMeshFeatures * places),
                                   model_.opacityOffset())};
    const float share = 1.0f / static_cast<float>(places);
    for (size_t place = first; place < first + size_t{places}; ++place)
      for (size_t c = 0; c < 3 && !colours.empty(); ++c) texel.colour[c] += share * colours[3 * place + c];
    texel.opacity = storedOpacity(texel.opacity, settings_.opaqueFrom, settings_.transparentBelow);
    return texel;
  }

  MeshModel& model_;
  const OctahedraDomain& domain_;
  const TriangleList& list_;
  const std::vector<TrianglePatch>& patches_;
  const MeshBakeSettings& settings_;
  uint32_t placesPerEdge_;
  std::vector<float> fitted_;  // the texels of a level that was fitted, [texels][kMeshFeatures]; else empty
  Array<float> positions_, encoded_, directions_;
  Array<uint32_t> patchOfPlace_, everyPlace_;
  std::vector<uint32_t> patchOfPlaces_ = std::vector<uint32_t>(kPlacesAtATime);
};

}  // namespace

uint32_t placesPerEdge(uint32_t level) {
  return std::min(1u << level, kMaxPlacesPerEdge);
}

BakedPatches bakePatches(MeshModel& model, uint32_t level, const FaceSet& faces, const MeshBakeSettings& settings) {
  const OctahedraDomain& domain = model.level(level).domain();
  const TriangleList list =
      listTriangles(domain.grids, domain.ownGrids, model.device().read(model.level(level).displacements().values.all()),
                    faces.bits());
  const std::vector<TrianglePatch> patches = pairTriangles(list);
  BakedPatches baked;
  baked.patchEdge = settings.patchEdge;
  baked.decoder = readDecoder(model);
  baked.directions = averageDirections(list, patches, faces);
  for (const TrianglePatch& patch : patches) {
    baked.pairs += patch.isPair ? 1 : 0;
    for (const uint32_t corner : patch.corners)
      for (int axis = 0; axis < 3; ++axis) baked.vertices.push_back(list.vertices[corner][axis]);
  }
  // The field is evaluated twice: first for the ranges of the features, of what is visible.
  TexelField field(model, level, list, patches, baked.directions, settings);
  for (auto& range : baked.ranges) {
    range.low = std::numeric_limits<float>::infinity();
    range.high = -range.low;
  }
  const bool hasRanges = level == 0 ? model.atlas().has_value() : model.coarseAtlas(level) != nullptr;
  for (uint32_t f = 0; hasRanges && f < kMeshFeatures; ++f)  // those that training has used
    baked.ranges[f] = {model.atlas()->ranges[2 * f], model.atlas()->ranges[2 * f + 1]};
  if (!hasRanges)
    field.forEachTexel(false, [&](size_t number, const FieldTexel& texel) {
      const uint32_t edge = settings.patchEdge, within = static_cast<uint32_t>(number % (size_t{edge} * edge));
      if (!isTexelUsed(number / (size_t{edge} * edge) < baked.pairs, within % edge, within / edge, edge)) return;
      for (uint32_t f = 0; texel.opacity > 0 && f < kMeshFeatures; ++f) {
        baked.ranges[f].low = std::min(baked.ranges[f].low, texel.features[f]);
        baked.ranges[f].high = std::max(baked.ranges[f].high, texel.features[f]);
      }
    });
  for (auto& range : baked.ranges) {
    if (!(range.low <= range.high)) range = {0, 0};
    if (range.low >= -kLargestMeshFeature && range.high <= kLargestMeshFeature) continue;
    throw Error(model.part().name, "",
                fmt::format("has features beyond {:g}, which no scene can hold", kLargestMeshFeature),
                "train again, into another folder, with a lower --set learning_rate");
  }
  if (!settings.texels) return baked;
  const size_t texels = patches.size() * settings.patchEdge * settings.patchEdge;
  baked.texels.reserve(texels * BakedPatches::kNumbers);
  field.forEachTexel(settings.baseColours, [&](size_t, const FieldTexel& texel) {
    for (uint32_t f = 0; f < kMeshFeatures; ++f) baked.texels.push_back(baked.ranges[f].encode(texel.features[f]));
    baked.texels.push_back(FeatureRange{0, 1}.encode(texel.opacity));
    for (size_t c = 0; settings.baseColours && c < 3; ++c)
      baked.baseColours.push_back(FeatureRange{0, 1}.encode(texel.colour[c]));
  });
  return baked;
}

}  // namespace tessera

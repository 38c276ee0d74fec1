#include "representations/mesh/content/infer_maps.h"

#include <algorithm>

#include "base/check.h"
#include "compute/cpu/device.h"
#include "representations/mesh/content/patch_texels.h"

namespace tessera {
namespace {

constexpr uint32_t kPlacesAtATime = 1 << 15;  // at least those of a patch
constexpr size_t kNumbersAtATime = 1 << 20;

void addPlaces(const PatchSet& set, uint32_t patch, std::vector<float>& positions) {
  const PatchEncoder& from = *set.encoder;
  std::array<Vec3d, 4> corners;
  for (uint32_t corner = 0; corner < 4; ++corner) corners[corner] = set.corner(patch, corner);
  const uint32_t perTexel = from.places * from.places;
  const auto place = [&](uint32_t at, uint32_t number) { return placeInTexel(at, number, from.places); };
  for (uint32_t texel = 0; texel < set.patchEdge * set.patchEdge; ++texel) {
    for (uint32_t number = 0; number < perTexel; ++number) {
      const Vec3d x = texelPosition(corners, patch < set.pairs, place(texel % set.patchEdge, number % from.places),
                                    place(texel / set.patchEdge, number / from.places), set.patchEdge);
      for (int axis = 0; axis < 3; ++axis)
        positions.push_back(static_cast<float>(std::clamp(from.scale[axis] * x[axis] + from.offset[axis], 0.0, 1.0)));
    }
  }
}

}  // namespace

MapInference::MapInference(Device& device, const MeshEncoder& encoder)
    : device_(device), grid_(encoder.grid), shape_(encoder.shape()), opacityOffset_(encoder.opacityOffset) {
  table_ = device.array<float>(encoder.table.size());
  std::vector<float> numbers;
  for (size_t first = 0; first < encoder.table.size(); first += numbers.size()) {
    numbers.resize(std::min<size_t>(kNumbersAtATime, encoder.table.size() - first));
    std::transform(encoder.table.begin() + static_cast<ptrdiff_t>(first),
                   encoder.table.begin() + static_cast<ptrdiff_t>(first + numbers.size()), numbers.begin(), fromHalf);
    device.write(table_.part(first, numbers.size()), std::span<const float>(numbers));
  }
  numbers.assign(shape_.parameters(), 0);
  forEachWeight(shape_, [&](size_t number, size_t index) { numbers[index] = fromHalf(encoder.weights[number]); });
  weights_ = device.uploadArray(numbers);
  const size_t rows = Matrix<float>::rowsOfPlane(kPlacesAtATime);
  positions_ = device.array<float>(size_t{3} * kPlacesAtATime);
  encodedArray_ = device.array<float>(rows * grid_.columns());
  encoded_ = Matrix<float>::grouped(encodedArray_, grid_.columns(), static_cast<uint32_t>(grid_.features), rows);
  features_ = device.array<float>(size_t{kMeshFeatures} * kPlacesAtATime);
}

// Returns the features, [places][kMeshFeatures], at positions in the unit cube, [places][3].
std::vector<float> MapInference::evaluate(std::span<const float> positions) {
  const Count places{static_cast<uint32_t>(positions.size() / 3)};
  device_.write(positions_.all(), positions);
  device_.run(HashGridForward{grid_, places, positions_, table_, encoded_});
  device_.run(MlpForward{shape_, places, encoded_, weights_, Matrix<float>(features_, kMeshFeatures), {}});
  return device_.read(features_.part(0, size_t{kMeshFeatures} * places.capacity));
}

void MapInference::infer(PatchSet& set, Bc4Effort effort) {
  CHECK(set.encoder.has_value() == true);
  const PatchEncoder& from = *set.encoder;
  allocateTextures(set);
  const size_t texels = size_t{set.patchEdge} * set.patchEdge, numbers = kMeshFeatures * from.places * from.places;
  const uint32_t patchesAtATime = static_cast<uint32_t>(kPlacesAtATime / (texels * from.places * from.places));
  std::vector<uint8_t> bytes(texels * kTexelNumbers);
  for (uint32_t first = 0; first < set.patches; first += patchesAtATime) {
    const uint32_t count = std::min(patchesAtATime, set.patches - first);
    std::vector<float> positions;
    for (uint32_t i = 0; i < count; ++i) addPlaces(set, first + i, positions);
    const std::vector<float> features = evaluate(positions);
    for (uint32_t i = 0; i < count; ++i) {
      for (size_t texel = 0; texel < texels; ++texel) {
        MeshTexel mean =
            averagePlaces(std::span(features).subspan((i * texels + texel) * numbers, numbers), opacityOffset_);
        mean.opacity = storedOpacity(mean.opacity, from.opaqueFrom, from.transparentBelow);
        uint8_t* const to = bytes.data() + texel * kTexelNumbers;
        for (uint32_t f = 0; f < kMeshFeatures; ++f) to[f] = set.ranges[f].encode(mean.features[f]);
        to[kMeshFeatures] = FeatureRange{0, 1}.encode(mean.opacity);
      }
      compressPatch(set, first + i, bytes.data(), effort);
    }
  }
}

void inferMapsOnCpu(MeshContent& content, int threads) {
  if (content.encoders.empty()) return;
  const std::unique_ptr<Device> device = makeCpuDevice(threads);
  for (uint32_t resource = 0; resource < content.encoders.size(); ++resource) {
    MapInference inference(*device, content.encoders[resource]->encoder);
    for (PatchSet& part : content.parts)
      if (part.encoder && part.encoder->resource == resource) inference.infer(part);
  }
}

}  // namespace tessera

// The rules that a mesh content must satisfy when it is written or read (docs/tile-format.md, section 8).
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "representations/mesh/content/mesh_payload.h"
#include "tiles/network_payload.h"
#include "tiles/tileset.h"

namespace tessera {
namespace {

using Broken = std::optional<std::string>;

constexpr double kFarthestVertex = 1e7, kLargestStep = 152;  // scene units
constexpr double kLargestPlacement = 1e12;                   // in an encoder's unit cube
constexpr double kBoxTolerance = 1e-6;                       // of the larger of 1 and the box's coordinate

Broken ruleOfEncoder(const PatchEncoder& encoder, const MeshContent& content) {
  if (content.isBackground) return "it has an encoder, but is of a background block";
  if (encoder.resource >= content.encoders.size()) return "its encoder is not among the resources of the content";
  for (const auto& numbers : {encoder.scale, encoder.offset})
    for (const double number : numbers)
      if (!(std::abs(number) <= kLargestPlacement)) return "the scale or offset of its encoder is out of bounds";
  if (encoder.places != 1 && encoder.places != 2 && encoder.places != 4)
    return "the places of its encoder are out of bounds";
  if (!(encoder.transparentBelow >= 0 && encoder.transparentBelow <= encoder.opaqueFrom && encoder.opaqueFrom <= 1))
    return "the opacities of its encoder are out of bounds";
  return std::nullopt;
}

Broken ruleOfPatchSet(const PatchSet& set, const MeshContent& content) {
  if (set.patchEdge < PatchSet::kMinPatchEdge || set.patchEdge > PatchSet::kMaxPatchEdge || set.patchEdge % 4 != 0)
    return "its patch_edge is out of bounds";
  if (set.patches > maxPatches(set.patchEdge) || set.pairs > set.patches)
    return "its patches or pairs are out of bounds";
  if (!(set.step >= 1e-12 && set.step <= kLargestStep)) return "its step is out of bounds";
  for (const double number : set.origin)
    if (!(std::abs(number) <= kFarthestVertex)) return "its origin is out of bounds";
  for (const FeatureRange& range : set.ranges) {
    if (!(range.low >= -kLargestMeshFeature && range.low <= range.high && range.high <= kLargestMeshFeature))
      return "a range is out of bounds";
  }
  if (set.vertices.size() != size_t{12} * set.patches) return "it has the wrong number of vertices";
  if (set.encoder) {
    if (set.patches == 0) return "it has an encoder, but no patches";
    if (const Broken broken = ruleOfEncoder(*set.encoder, content)) return broken;
  }
  const auto isSized = [&](const std::vector<uint8_t>& blocks, uint32_t bytes) {
    return (set.encoder && blocks.empty()) || blocks.size() == set.textureBlocks() * bytes;
  };
  for (const std::vector<uint8_t>& blocks : set.featureBlocks)
    if (!isSized(blocks, PatchSet::kBc5Bytes)) return "its features have the wrong size";
  if (!isSized(set.opacityBlocks, PatchSet::kBc4Bytes)) return "its opacity has the wrong size";
  return ruleOfNetwork(set.decoder, kMeshFeatures + kMeshHarmonics, 3);
}

}  // namespace

std::optional<std::string> validationError(const MeshContent& content) {
  if (content.skyEdge == 1 || content.skyEdge > kMaxSkyEdge) return "the edge of its sky is out of bounds";
  if (content.skyEdge > 0 && !content.isBackground) return "it has a sky, but is no background block";
  if (content.sky.size() != size_t{18} * content.skyEdge * content.skyEdge) return "its sky has the wrong size";
  if (content.parts.empty()) return "there are no parts";
  for (size_t i = 0; i < content.parts.size(); ++i)
    if (const Broken broken = ruleOfPatchSet(content.parts[i], content)) return fmt::format("part {}: {}", i, *broken);
  return std::nullopt;
}

std::optional<std::string> mismatchWithTileset(const MeshContent& content, const TileContent& declared) {
  if (content.isBackground != declared.backgroundBlock)
    return declared.backgroundBlock ? "it is not a background block" : "it is a background block";
  for (size_t i = 0; i < content.parts.size(); ++i) {
    const PatchSet& part = content.parts[i];
    for (uint32_t vertex = 0; vertex < 4 * part.patches; ++vertex) {
      // Corner 3 of a patch with one triangle has no meaning.
      if (vertex % 4 == 3 && vertex / 4 >= part.pairs) continue;
      const Vec3d at = part.corner(vertex / 4, vertex % 4);
      for (int axis = 0; axis < 3; ++axis) {
        const double low = declared.box.low[axis], high = declared.box.high[axis];
        if (at[axis] < low - kBoxTolerance * std::max(1.0, std::abs(low)) ||
            at[axis] > high + kBoxTolerance * std::max(1.0, std::abs(high)))
          return fmt::format("part {} reaches out of the content's box", i);
      }
    }
  }
  return std::nullopt;
}

}  // namespace tessera

// The rules that hold for volume contents, both written and read (docs/tile-format.md, section 6).
#include "raymarch/content/content_rules.h"
#include "representations/volume/content/volume_payload.h"

namespace tessera {
namespace {

constexpr float kLargestRange = 100;
constexpr uint32_t kInputs = 34, kOutputs = 3;

Broken ruleOfPart(const VolumePart& part) {
  if (part.voxels % VolumePart::kMacroblock != 0 || part.voxels < 1 || part.voxels > kMaxVoxels) {
    return "its number of voxels is out of bounds";
  }
  if (part.planes % VolumePart::kDistanceCell != 0 || part.planes < 1 || part.planes > kMaxPlanes) {
    return "its number of plane texels is out of bounds";
  }
  if (auto broken = ruleOfPlace(part)) return broken;
  if (auto broken = ruleOfMacroblocks(part, part.voxels, part.voxelBytes.size(), VolumePart::kAttributes))
    return broken;
  for (const std::vector<uint8_t>& plane : part.planeBytes) {
    if (plane.size() != size_t{part.planes} * part.planes * VolumePart::kAttributes)
      return "a plane has the wrong number of texels";
  }
  const uint32_t cells = part.planes / VolumePart::kDistanceCell;
  if (part.distances.size() != size_t{cells} * cells * cells) return "its distances are not those of its cells";
  return std::nullopt;
}

}  // namespace

uint64_t texelBytes(const VolumePart& part, uint64_t storedMacroblocks) {
  const auto cube = [](uint64_t edge) { return edge * edge * edge; };
  return 3 * VolumePart::kAttributes * uint64_t{part.planes} * part.planes +
         cube(part.planes / VolumePart::kDistanceCell) + storedMacroblocks * VolumePart::kMacroblockBytes +
         sizeof(uint32_t) * cube(part.voxels / VolumePart::kMacroblock);
}

std::optional<std::string> mismatchWithTileset(const VolumeContent& content, const TileContent& declared) {
  return mismatchOfParts(content.parts, declared);
}

std::optional<std::string> validationError(const VolumeContent& content) {
  for (const float range : {content.featureRange, content.densityRange}) {
    if (!(range > 0 && range <= kLargestRange)) return "a range is out of bounds";
  }
  if (content.stepsPerTexel < 1 || content.stepsPerTexel > VolumeContent::kMaxStepsPerTexel) {
    return "the steps per texel are out of bounds";
  }
  if (auto broken = ruleOfNetwork(content.network, kInputs, kOutputs)) return broken;
  return ruleOfParts(content.parts, ruleOfPart);
}

}  // namespace tessera

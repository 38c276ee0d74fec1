// The rules that a volume's content keeps, written or read (docs/tile-format.md, section 6).
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "tiles/volume_payload.h"

namespace tessera {
namespace {

using Broken = std::optional<std::string>;

constexpr float kLargestRange = 100;
constexpr uint32_t kInputs = 34, kOutputs = 3;

bool isFinite(const std::vector<float>& numbers) {
  return std::all_of(numbers.begin(), numbers.end(), [](float number) { return std::isfinite(number); });
}

Broken ruleOfNetwork(const std::vector<DenseLayer>& network) {
  if (network.empty() || network.size() > kMostLayers) return "the network has no layers, or too many";
  uint32_t width = kInputs;
  for (const DenseLayer& layer : network) {
    if (layer.inputs != width || layer.outputs < 1 || layer.outputs > kMostLayerWidth) {
      return "the network's layers do not follow one another";
    }
    width = layer.outputs;
    if (layer.weights.size() != size_t{layer.inputs} * layer.outputs || layer.biases.size() != layer.outputs) {
      return "the network's layers have not the numbers that they need";
    }
    if (!isFinite(layer.weights) || !isFinite(layer.biases)) return "the network holds a number that is not finite";
  }
  if (width != kOutputs) return "the network does not end in a colour";
  return std::nullopt;
}

// A bounded part owns nothing outside its domain, but for rounding.
Broken ruleOfPlace(const VolumePart& part) {
  for (size_t a = 0; a < 3; ++a) {
    const float centre = part.centre[a], scale = part.scale[a], low = part.low[a], high = part.high[a];
    if (!(std::abs(centre) <= kFarthestInScene) || !(scale >= 1e-6f && scale <= kFarthestInScene)) {
      return "its centre or scale is out of bounds";
    }
    if (!(low >= -kFarthestInScene && low < high && high <= kFarthestInScene)) return "its box is none";
    const float slack = 1e-3f * scale;
    if (!part.contracted && (low < centre - scale - slack || high > centre + scale + slack)) {
      return "it is bounded, but its box leaves its domain";
    }
  }
  if (part.surround && !part.contracted) return "a surround is not contracted";
  return std::nullopt;
}

Broken ruleOfMacroblocks(const VolumePart& part) {
  const uint32_t stored = part.storedMacroblocks(), edge = part.voxels / VolumePart::kMacroblock;
  if (part.voxelBytes.size() % VolumePart::kMacroblockBytes != 0) return "its voxels are no whole macroblocks";
  if (stored > kMostStored) return "it has more macroblocks than a picture holds";
  if (part.macroblocks.size() != size_t{edge} * edge * edge) return "its macroblock numbers are not those of its grid";
  std::vector<bool> used(stored);
  uint32_t count = 0;
  for (const uint32_t number : part.macroblocks) {
    if (number == VolumePart::kEmpty) continue;
    if (number >= stored) return "the number of a macroblock is out of range";
    if (used[number]) return "a macroblock is used twice";
    used[number] = true;
    ++count;
  }
  if (count != stored) return "a macroblock is never used";
  return std::nullopt;
}

Broken ruleOfPart(const VolumePart& part) {
  if (part.voxels % VolumePart::kMacroblock != 0 || part.voxels < 1 || part.voxels > kMostVoxels) {
    return "its number of voxels is out of bounds";
  }
  if (part.planes % VolumePart::kDistanceCell != 0 || part.planes < 1 || part.planes > kMostPlanes) {
    return "its number of plane texels is out of bounds";
  }
  if (auto broken = ruleOfPlace(part)) return broken;
  if (auto broken = ruleOfMacroblocks(part)) return broken;
  for (const std::vector<uint8_t>& plane : part.planeBytes) {
    if (plane.size() != size_t{part.planes} * part.planes * VolumePart::kAttributes)
      return "a plane has not its texels";
  }
  const uint32_t cells = part.planes / VolumePart::kDistanceCell;
  if (part.distances.size() != size_t{cells} * cells * cells) return "its distances are not those of its cells";
  return std::nullopt;
}

bool overlap(const VolumePart& one, const VolumePart& other) {
  for (size_t a = 0; a < 3; ++a) {
    const float slack = 1e-3f * std::min(one.scale[a], other.scale[a]);
    if (one.high[a] <= other.low[a] + slack || other.high[a] <= one.low[a] + slack) return false;
  }
  return true;
}

}  // namespace

uint64_t texelBytes(const VolumePart& part, uint64_t storedMacroblocks) {
  const auto cube = [](uint64_t edge) { return edge * edge * edge; };
  return 3 * VolumePart::kAttributes * uint64_t{part.planes} * part.planes +
         cube(part.planes / VolumePart::kDistanceCell) + storedMacroblocks * VolumePart::kMacroblockBytes +
         sizeof(uint32_t) * cube(part.voxels / VolumePart::kMacroblock);
}

std::optional<std::string> brokenRule(const VolumeContent& content) {
  for (const float range : {content.featureRange, content.densityRange}) {
    if (!(range > 0 && range <= kLargestRange)) return "a range is out of bounds";
  }
  if (content.stepsPerTexel < 1 || content.stepsPerTexel > VolumeContent::kMostStepsPerTexel) {
    return "the steps per texel are out of bounds";
  }
  if (auto broken = ruleOfNetwork(content.network)) return broken;
  if (content.parts.empty()) return "there is no part";
  for (size_t i = 0; i < content.parts.size(); ++i) {
    if (auto broken = ruleOfPart(content.parts[i])) return fmt::format("part {}: {}", i, *broken);
    if (content.parts[i].surround && content.parts.size() > 1) return "a surround is not alone";
    for (size_t j = 0; j < i; ++j) {
      if (overlap(content.parts[i], content.parts[j])) return fmt::format("parts {} and {} overlap", j, i);
    }
  }
  return std::nullopt;
}

std::optional<std::string> brokenPromise(const VolumeContent& content, const TileContent& promised) {
  const SceneBox& box = promised.box;
  const auto slack = [](double x) { return 1e-6 * std::max(1.0, std::abs(x)); };  // parts are rounded to floats
  for (size_t i = 0; i < content.parts.size(); ++i) {
    const VolumePart& part = content.parts[i];
    if (part.surround != promised.surround) {
      return fmt::format("part {} is {} surround, and tileset.json says that the content is {}", i,
                         part.surround ? "a" : "no", promised.surround ? "one" : "none");
    }
    for (Eigen::Index a = 0; a < 3; ++a) {
      const auto axis = static_cast<size_t>(a);
      if (part.low[axis] < box.low[a] - slack(box.low[a]) || part.high[axis] > box.high[a] + slack(box.high[a])) {
        return fmt::format("part {} owns what lies outside of the content's box in tileset.json", i);
      }
    }
  }
  return std::nullopt;
}

}  // namespace tessera

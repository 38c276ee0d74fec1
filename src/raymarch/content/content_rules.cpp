#include "raymarch/content/content_rules.h"

#include <algorithm>
#include <cmath>

namespace tessera {

Broken ruleOfPlace(const ContentPart& part) {
  for (size_t a = 0; a < 3; ++a) {
    const float centre = part.centre[a], scale = part.scale[a], low = part.low[a], high = part.high[a];
    if (!(std::abs(centre) <= kFarthestInScene) || !(scale >= 1e-6f && scale <= kFarthestInScene)) {
      return "its centre or scale is out of bounds";
    }
    if (!(low >= -kFarthestInScene && low < high && high <= kFarthestInScene))
      return "its box is empty or out of bounds";
    const float slack = 1e-3f * scale;
    if (!part.contracted && (low < centre - scale - slack || high > centre + scale + slack)) {
      return "it is bounded, but its box is not within its domain";
    }
  }
  if (part.backgroundBlock && !part.contracted) return "a background block is not contracted";
  return std::nullopt;
}

Broken ruleOfMacroblocks(const ContentPart& part, uint32_t texels, uint64_t bytes, uint32_t bytesOfTexel) {
  const uint64_t bytesOfBlock = uint64_t{ContentPart::kStoredTexels} * bytesOfTexel, stored = bytes / bytesOfBlock;
  const uint32_t edge = texels / ContentPart::kMacroblock;
  if (bytes % bytesOfBlock != 0) return "its voxels are not whole macroblocks";
  if (stored > kMaxStored) return "it has more macroblocks than an image can contain";
  if (part.macroblocks.size() != size_t{edge} * edge * edge) return "its macroblock numbers are not those of its grid";
  std::vector<bool> used(stored);
  uint64_t count = 0;
  for (const uint32_t number : part.macroblocks) {
    if (number == ContentPart::kEmpty) continue;
    if (number >= stored) return "the number of a macroblock is out of range";
    if (used[number]) return "a macroblock is used twice";
    used[number] = true;
    ++count;
  }
  if (count != stored) return "a macroblock is never used";
  return std::nullopt;
}

bool overlap(const ContentPart& one, const ContentPart& other) {
  for (size_t a = 0; a < 3; ++a) {
    const float slack = 1e-3f * std::min(one.scale[a], other.scale[a]);
    if (one.high[a] <= other.low[a] + slack || other.high[a] <= one.low[a] + slack) return false;
  }
  return true;
}

Broken mismatchOfPart(const ContentPart& part, size_t number, const TileContent& declared) {
  const SceneBox& box = declared.box;
  const auto slack = [](double x) { return 1e-6 * std::max(1.0, std::abs(x)); };  // parts' boxes are rounded to floats
  if (part.backgroundBlock != declared.backgroundBlock) {
    return fmt::format("part {} is {} background block, and tileset.json says that the content is {}", number,
                       part.backgroundBlock ? "a" : "not a", declared.backgroundBlock ? "one" : "not");
  }
  for (Eigen::Index a = 0; a < 3; ++a) {
    const auto axis = static_cast<size_t>(a);
    if (part.low[axis] < box.low[a] - slack(box.low[a]) || part.high[axis] > box.high[a] + slack(box.high[a])) {
      return fmt::format("part {} owns what lies outside of the content's box in tileset.json", number);
    }
  }
  return std::nullopt;
}

}  // namespace tessera

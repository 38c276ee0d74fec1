// Rules that hold for contents of every ray-marched representation, both written and read (docs/tile-format.md,
// sections 3 and 5). Each function returns a description of the violation, for people, or nothing if the rule holds.
#pragma once

#include <fmt/format.h>

#include <optional>
#include <string>

#include "raymarch/content/content_part.h"
#include "tiles/network_payload.h"
#include "tiles/tileset.h"

namespace tessera {

using Broken = std::optional<std::string>;

// Checks the placement of a part: a bounded part owns nothing outside its domain, up to rounding.
Broken ruleOfPlace(const ContentPart& part);
// Checks the macroblocks of a part that has `texels` texels along an axis: `bytes` bytes of voxels with `bytesOfTexel`
// bytes each.
Broken ruleOfMacroblocks(const ContentPart& part, uint32_t texels, uint64_t bytes, uint32_t bytesOfTexel);
// Returns whether the regions that two parts own overlap by more than rounding.
bool overlap(const ContentPart& one, const ContentPart& other);

// Checks `rule` for each part, that a background block is the only part, and that no two parts overlap.
template <class Part, class Rule>
Broken ruleOfParts(const std::vector<Part>& parts, const Rule& rule) {
  if (parts.empty()) return "there are no parts";
  for (size_t i = 0; i < parts.size(); ++i) {
    if (auto broken = rule(parts[i])) return fmt::format("part {}: {}", i, *broken);
    if (parts[i].backgroundBlock && parts.size() > 1) return "a background block is not alone";
    for (size_t j = 0; j < i; ++j) {
      if (overlap(parts[i], parts[j])) return fmt::format("parts {} and {} overlap", j, i);
    }
  }
  return std::nullopt;
}

// Implement Content::mismatchWith for a content with these parts.
Broken mismatchOfPart(const ContentPart& part, size_t number, const TileContent& declared);
template <class Part>
Broken mismatchOfParts(const std::vector<Part>& parts, const TileContent& declared) {
  for (size_t i = 0; i < parts.size(); ++i) {
    if (auto broken = mismatchOfPart(parts[i], i, declared)) return broken;
  }
  return std::nullopt;
}

}  // namespace tessera

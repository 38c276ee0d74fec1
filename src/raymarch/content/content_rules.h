// Rules that contents of every representation keep, written or read (docs/tile-format.md, sections 3 and 5). Each says
// what is broken, for people; nothing where it holds.
#pragma once

#include <fmt/format.h>

#include <optional>
#include <string>

#include "raymarch/content/content_part.h"
#include "tiles/network_payload.h"
#include "tiles/tileset.h"

namespace tessera {

using Broken = std::optional<std::string>;

// Where the part stands: a bounded one owns nothing outside its domain, but for rounding.
Broken ruleOfPlace(const ContentPart& part);
// `texels` along an axis; so many bytes of them are there, of so many a texel.
Broken ruleOfMacroblocks(const ContentPart& part, uint32_t texels, uint64_t bytes, uint32_t bytesOfTexel);
bool overlap(const ContentPart& one, const ContentPart& other);

// `rule` of each; a surround is alone, and no two own the same.
template <class Part, class Rule>
Broken ruleOfParts(const std::vector<Part>& parts, const Rule& rule) {
  if (parts.empty()) return "there is no part";
  for (size_t i = 0; i < parts.size(); ++i) {
    if (auto broken = rule(parts[i])) return fmt::format("part {}: {}", i, *broken);
    if (parts[i].surround && parts.size() > 1) return "a surround is not alone";
    for (size_t j = 0; j < i; ++j) {
      if (overlap(parts[i], parts[j])) return fmt::format("parts {} and {} overlap", j, i);
    }
  }
  return std::nullopt;
}

// Content::mismatchWith of a content that has these parts.
Broken mismatchOfPart(const ContentPart& part, size_t number, const TileContent& promised);
template <class Part>
Broken mismatchOfParts(const std::vector<Part>& parts, const TileContent& promised) {
  for (size_t i = 0; i < parts.size(); ++i) {
    if (auto broken = mismatchOfPart(parts[i], i, promised)) return broken;
  }
  return std::nullopt;
}

}  // namespace tessera

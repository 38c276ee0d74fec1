// What a content states of itself that consists of parts which rays are marched through (tiles/content.h).
#pragma once

#include <algorithm>

#include "bake/baker.h"

namespace tessera {

// `texels`: that a domain of the finest kind that it holds is fine, along an axis. A bounded domain is 2 wide, where
// half the edge of a finest block is 1; the error is the edge of a texel. A background's domain is 4 wide, and its
// texels are smallest at the scene's box, where each is as large as its part's scale has it.
template <class Content>
ContentSummary partSummary(const Content& content, uint32_t texels) {
  ContentSummary summary;
  summary.box = {Vec3d::Constant(1e30), Vec3d::Constant(-1e30)};
  summary.memoryBytes = bytesInMemory(content);
  uint64_t macroblocks = 0;
  double largestScale = 0;  // of its parts, along any axis
  for (const auto& part : content.parts) {
    summary.box.low = summary.box.low.cwiseMin(Vec3d(part.low[0], part.low[1], part.low[2]));
    summary.box.high = summary.box.high.cwiseMax(Vec3d(part.high[0], part.high[1], part.high[2]));
    summary.isBackground = summary.isBackground || part.surround;
    macroblocks += part.storedMacroblocks();
    for (const float scale : part.scale) largestScale = std::max<double>(largestScale, scale);
  }
  summary.geometricError = summary.isBackground ? largestScale * 4.0 / texels : 2.0 / texels;
  summary.counts = {{"macroblocks", macroblocks}};
  return summary;
}

}  // namespace tessera

// Summarises a ray-marched content, which consists of parts, for the baker (ContentSummary in bake/baker.h).
#pragma once

#include <algorithm>

#include "bake/baker.h"

namespace tessera {

// Returns the summary of a content whose finest parts have `texels` texels along an axis. The geometric error is the
// edge of a texel of the coarsest part: a bounded domain is 2 scene units wide, where half the edge of a finest block
// is
// 1. A contracted domain, of a background block or a block at the border, is 4 units of its part's scale wide, and its
// texels are smallest within the scene's box, where the contraction is the identity.
template <class Content>
ContentSummary partSummary(const Content& content, uint32_t texels) {
  ContentSummary summary;
  summary.box = {Vec3d::Constant(1e30), Vec3d::Constant(-1e30)};
  summary.memoryBytes = bytesInMemory(content);
  uint64_t macroblocks = 0;
  double widest = 0;  // domain of a part along any axis
  for (const auto& part : content.parts) {
    summary.box.low = summary.box.low.cwiseMin(Vec3d(part.low[0], part.low[1], part.low[2]));
    summary.box.high = summary.box.high.cwiseMax(Vec3d(part.high[0], part.high[1], part.high[2]));
    summary.isBackground = summary.isBackground || part.backgroundBlock;
    macroblocks += part.storedMacroblocks();
    const double largestScale = *std::max_element(part.scale.begin(), part.scale.end());
    widest = std::max(widest, part.contracted ? 4 * largestScale : 2);
  }
  summary.geometricError = widest / texels;
  summary.counts = {{"macroblocks", macroblocks}};
  return summary;
}

}  // namespace tessera

// Kernel arguments of ray-marched contents, whatever their representation.
#pragma once

#include "raymarch/content/content_part.h"
#include "render/drawer.h"
#include "shaders/render/arguments_view.h"

namespace tessera {

// Returns kernel arguments that state where a part stands in the scene; all others are zero.
template <class Arguments>
Arguments placedArguments(const ContentPart& part) {
  Arguments placed = {};
  for (int a = 0; a < 3; ++a) {
    placed.centre[a] = part.centre[a];
    placed.scale[a] = part.scale[a];
    placed.low[a] = part.low[a];
    placed.high[a] = part.high[a];
  }
  placed.contracted = part.contracted;
  return placed;
}

// Returns the arguments with which a kernel draws what a content on the GPU holds within the box from `low` to `high`,
// scene units. The arguments that only one representation has are left at zero.
template <class Arguments, class GpuContent>
Arguments drawArguments(const arguments::ViewArguments& view, const GpuContent& content, const Vec3d& low,
                        const Vec3d& high, bool isBackgroundBlock) {
  Arguments draw = {};
  draw.view = view;
  for (int a = 0; a < 3; ++a) {
    draw.low[a] = static_cast<float>(low[a]);
    draw.high[a] = static_cast<float>(high[a]);
  }
  draw.isBackgroundBlock = isBackgroundBlock;
  draw.partCount = content.partCount;
  draw.parts = content.parts;
  return draw;
}

}  // namespace tessera

// What kernels are told of ray-marched contents, whatever their representation.
#pragma once

#include "raymarch/content/content_part.h"
#include "render/drawer.h"
#include "shaders/render/arguments_view.h"

namespace tessera {

// What a kernel knows of where a part stands.
template <class Arguments>
Arguments placedArguments(const ContentPart& part) {
  Arguments made = {};
  for (int a = 0; a < 3; ++a) {
    made.centre[a] = part.centre[a];
    made.scale[a] = part.scale[a];
    made.low[a] = part.low[a];
    made.high[a] = part.high[a];
  }
  made.contracted = part.contracted;
  return made;
}

// Of a content on the GPU, the part in a box.
template <class Arguments, class Held>
Arguments drawArguments(const arguments::ViewArguments& view, const Held& content, const Vec3d& low, const Vec3d& high,
                        bool isSurround) {
  Arguments made = {};
  made.view = view;
  for (int a = 0; a < 3; ++a) {
    made.low[a] = static_cast<float>(low[a]);
    made.high[a] = static_cast<float>(high[a]);
  }
  made.isSurround = isSurround;
  made.partCount = content.partCount;
  made.parts = content.parts;
  return made;
}

}  // namespace tessera

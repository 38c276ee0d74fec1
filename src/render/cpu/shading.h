// How contents of one representation become the colour of a ray.
#pragma once

#include <array>

#include "render/cpu/march.h"
#include "render/cpu/part_path.h"

namespace tessera {

// Of all contents along a ray.
struct DrawnPixel {
  std::array<float, 3> colour = {0, 0, 0};  // premultiplied
  float transmittance = 1;
  float depth = 0;  // scene units along the ray, premultiplied
};

// Shading<Content>::Type is made of the contents of a drawing, and is asked for one ray after another:
//   begin(direction)              a unit vector, scene axes
//   transmittance()               of what has been added so far
//   march(content, part, …)       goes on with a content's composite, whose parts in front of this one it holds
//   add(composite, number)        of a content, front to back; contents have the numbers of their places in the drawing
//   end(pixel)                    the pixel may get its colour as late as in finish()
//   finish()                      after a number of rays
template <class Content>
struct Shading;
template <class Content>
using ShadingOf = typename Shading<Content>::Type;

}  // namespace tessera

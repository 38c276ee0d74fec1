// The rays of a camera.
// Reads: ViewArguments, pointAt(). Defines: toVec3(), rayDirection(), farthestDistance(), storeSurface(), boxPosition(),
// boxDirection(), isHidden(), kSceneEnd.

const float kSceneEnd = 1e6;  // scene units: there are no samples beyond

vec3 toVec3(float numbers[3]) { return vec3(numbers[0], numbers[1], numbers[2]); }

// Returns the unit direction in the scene; zero outside the lens.
vec3 rayDirection(ViewArguments view, uint pixel) {
  const vec3 d = pointAt(view.directions, pixel);
  if (d == vec3(0)) return d;
  vec3 turned;
  for (uint row = 0; row < 3; ++row) {
    turned[row] = view.sceneFromCamera[3 * row] * d.x + view.sceneFromCamera[3 * row + 1] * d.y +
                  view.sceneFromCamera[3 * row + 2] * d.z;
  }
  return normalize(turned);
}

// Returns the distance at which opaque geometry ends the ray.
float farthestDistance(ViewArguments view, uint pixel) {
  const float cosine = view.directions.values[3 * pixel + 2];
  if (!IS_SET(view.opaqueDepth) || !(cosine > 0)) return kSceneEnd;
  return min(kSceneEnd, view.opaqueDepth.values[pixel] / (cosine * view.scale));
}

// Stores the distance of the surface along the ray, if it is wanted.
void storeSurface(ViewArguments view, uint pixel, float distance) {
  if (!IS_SET(view.surface)) return;
  view.surface.values[pixel] = distance * view.directions.values[3 * pixel + 2] * view.scale;
}

// Returns the direction in the axes of a hidden box, in which the box ranges from -0.5 to 0.5.
vec3 boxDirection(ViewArguments view, uint box, vec3 d) {
  vec3 inBox;
  for (uint row = 0; row < 3; ++row) {
    const uint first = 12 * box + 4 * row;
    inBox[row] = view.boxes.values[first] * d.x + view.boxes.values[first + 1] * d.y + view.boxes.values[first + 2] * d.z;
  }
  return inBox;
}

vec3 boxPosition(ViewArguments view, uint box, vec3 x) {
  const uint first = 12 * box + 3;
  return boxDirection(view, box, x) + vec3(view.boxes.values[first], view.boxes.values[first + 4], view.boxes.values[first + 8]);
}

// Returns whether a place in the scene lies in a hidden box.
bool isHidden(ViewArguments view, vec3 x, bool isBackground) {
  const uint count = isBackground ? view.boxCount : view.boxesOfAll;
  for (uint box = 0; box < count; ++box) {
    const vec3 inBox = abs(boxPosition(view, box, x));
    if (max(inBox.x, max(inBox.y, inBox.z)) <= 0.5) return true;
  }
  return false;
}

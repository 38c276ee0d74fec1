// The rays of a camera.
// Reads: ViewArguments, pointAt(). Defines: toVec3(), rayDirection(), farthestDistance(), kSceneEnd.

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

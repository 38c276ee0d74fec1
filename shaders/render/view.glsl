// A camera's rays, and what has been added up along them.
// Reads: ViewArguments. Defines: pixelIndex(), vectorOf(), rayDirection(), farthestOf(), kSceneEnd.

const float kSceneEnd = 1e6;  // scene units: no sample beyond

// The number of this invocation's pixel; false beside the picture.
bool pixelIndex(ViewArguments view, out uint pixel) {
  pixel = gl_GlobalInvocationID.y * view.width + gl_GlobalInvocationID.x;
  return gl_GlobalInvocationID.x < view.width && gl_GlobalInvocationID.y < view.height;
}

vec3 vectorOf(float numbers[3]) { return vec3(numbers[0], numbers[1], numbers[2]); }

// In the scene, of length 1; zero beyond the lens.
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

// Where what is opaque ends the ray.
float farthestOf(ViewArguments view, uint pixel) {
  const float cosine = view.directions.values[3 * pixel + 2];
  if (!WANTED(view.opaqueDepth) || !(cosine > 0)) return kSceneEnd;
  return min(kSceneEnd, view.opaqueDepth.values[pixel] / (cosine * view.scale));
}

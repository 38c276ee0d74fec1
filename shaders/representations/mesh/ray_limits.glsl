// Where hits of a ray count.
// Reads: ViewArguments, PlacedPartArguments. Defines: behindBox(), isInCells().

// Returns the distance from which on the background block is seen.
float behindBox(ViewArguments view, vec3 direction) {
  float near = view.near, far = kSceneEnd;
  for (uint axis = 0; axis < 3; ++axis) {
    const float low = view.low[axis] - view.origin[axis], high = view.high[axis] - view.origin[axis];
    if (direction[axis] == 0) {
      if (low > 0 || high <= 0) return view.near;
      continue;
    }
    const float a = low / direction[axis], b = high / direction[axis];
    near = max(near, min(a, b));
    far = min(far, max(a, b));
  }
  return near < far ? far : view.near;
}

// Whether a place, relative to the eye, is in the cells in which a part is drawn.
bool isInCells(PlacedPartArguments placed, vec3 fromEye) {
  return fromEye.x >= placed.low[0] && fromEye.y >= placed.low[1] && fromEye.x < placed.high[0] &&
         fromEye.y < placed.high[1];
}

// Access to arrays of three-dimensional points.
// Defines: pointAt(), storePoint().

vec3 pointAt(FloatPointer points, uint index) {
  return vec3(points.values[3 * index], points.values[3 * index + 1], points.values[3 * index + 2]);
}

void storePoint(FloatPointer points, uint index, vec3 point) {
  for (uint axis = 0; axis < 3; ++axis) points.values[3 * index + axis] = point[axis];
}

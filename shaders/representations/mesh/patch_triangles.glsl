// The triangles of patches, and where rays from the eye hit them. Triangle 2p and 2p + 1 belong to patch p if it has two;
// the others follow.
// Reads: MeshPartArguments, PlacedPartArguments. Defines: PatchTriangle, patchTriangle(), patchCorner(), TriangleHit,
// hitTriangle().

struct PatchTriangle {
  uint patchNumber;
  bool isSecond;
};

PatchTriangle patchTriangle(uint pairs, uint triangle) {
  if (triangle < 2 * pairs) return PatchTriangle(triangle / 2, (triangle & 1) != 0);
  return PatchTriangle(triangle - pairs, false);
}

// The first triangle has the corners 0, 1, 2, the second one 3, 2, 1.
uint cornerOfTriangle(bool isSecond, uint number) { return isSecond ? 3 - number : number; }

// Returns the three numbers of a corner.
vec3 patchCorner(UintPointer vertices, uint patchNumber, uint corner) {
  // A patch has twelve numbers of 16 bits, so a corner begins at the middle of a word if its number is odd.
  const uint first = 6 * patchNumber + 3 * corner / 2;
  const uint a = vertices.values[first], b = vertices.values[first + 1];
  return (corner & 1) == 0 ? vec3(a & 0xffff, a >> 16, b & 0xffff) : vec3(a >> 16, b & 0xffff, b >> 16);
}

struct TriangleHit {
  float distance;
  vec2 place;      // column and row in the patch, 0 to 1
  bool isOutside;  // of the triangle; the place is then the nearest one in it
};

// Intersects the plane of a triangle. `direction` has length 1.
TriangleHit hitTriangle(PlacedPartArguments placed, uint triangle, vec3 direction) {
  UintPointer vertices = placed.part.value.vertices;
  const PatchTriangle of = patchTriangle(placed.part.value.pairs, triangle);
  const vec3 first = patchCorner(vertices, of.patchNumber, cornerOfTriangle(of.isSecond, 0));
  const vec3 a = vec3(placed.origin[0], placed.origin[1], placed.origin[2]) + placed.step * first;
  const vec3 ab = placed.step * (patchCorner(vertices, of.patchNumber, cornerOfTriangle(of.isSecond, 1)) - first);
  const vec3 ac = placed.step * (patchCorner(vertices, of.patchNumber, cornerOfTriangle(of.isSecond, 2)) - first);
  const vec3 p = cross(direction, ac), q = cross(-a, ab);
  const float volume = dot(ab, p);
  vec2 weights = vec2(0);
  if (volume != 0) weights = vec2(dot(-a, p), dot(direction, q)) / volume;
  TriangleHit hit;
  hit.isOutside = min(weights.x, weights.y) < 0 || weights.x + weights.y > 1;
  weights = clamp(weights, 0, 1);
  weights /= max(1, weights.x + weights.y);
  hit.distance = dot(a + weights.x * ab + weights.y * ac, direction);
  hit.place = of.isSecond ? 1 - weights : weights;
  return hit;
}

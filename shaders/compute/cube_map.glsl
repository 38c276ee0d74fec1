// The places of directions on cube maps, as in src/compute/cube_map.h.
// Defines: CubeMapPlace, findCubeMapPlace(), cubeMapTexel(), cubeMapWeight().

struct CubeMapPlace {
  uint texel;    // the first of the four texels around the place
  vec2 between;  // how far it is from there to the next column and row
};

// Returns false for a direction of zero.
bool findCubeMapPlace(uint resolution, vec3 direction, out CubeMapPlace place) {
  const vec3 sizes = abs(direction);
  uint axis = 0;
  if (sizes.y > sizes.x) axis = 1;
  if (sizes.z > sizes[axis]) axis = 2;
  if (!(sizes[axis] > 0)) return false;
  // The quotient of two equal numbers may be above 1 by a rounding error.
  const vec2 across = vec2(direction[(axis + 1) % 3], direction[(axis + 2) % 3]) / sizes[axis];
  const vec2 at = (clamp(across, -1, 1) + 1) * (0.5 * float(resolution - 1));
  const uvec2 first = min(uvec2(at), uvec2(resolution - 2));
  const uint side = 2 * axis + (direction[axis] < 0 ? 1 : 0);
  place.texel = (side * resolution + first.y) * resolution + first.x;
  place.between = at - vec2(first);
  return true;
}

// The corners 0 to 3 are the four texels: bit 0 selects the next column, and bit 1 the next row.
uint cubeMapTexel(CubeMapPlace place, uint resolution, uint corner) {
  return place.texel + (corner & 1) + (corner >> 1) * resolution;
}

float cubeMapWeight(CubeMapPlace place, uint corner) {
  return ((corner & 1) != 0 ? place.between.x : 1 - place.between.x) *
         (corner >> 1 != 0 ? place.between.y : 1 - place.between.y);
}

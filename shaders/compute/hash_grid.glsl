// Where a point lies in one level of the hash grid (src/compute/hash_grid.h says the convention).
// Reads: LevelArguments. Defines: Cell, cellOf(), upperSides(), cornerEntry(), cornerWeight().

struct Cell {
  uvec3 lattice;  // the lower corner
  vec3 fraction;  // within the cell
};

Cell cellOf(vec3 position, LevelArguments level) {
  const vec3 scaled = position * level.scale + 0.5;
  const vec3 lower = floor(scaled);
  return Cell(uvec3(ivec3(lower)), scaled - lower);
}

// Corner 0..7: bit a says whether it is on the upper side of axis a.
bvec3 upperSides(uint corner) { return bvec3(corner & 1, corner & 2, corner & 4); }

// → the corner's entry in the table of all levels.
uint cornerEntry(Cell cell, uint corner, LevelArguments level) {
  const uvec3 c = cell.lattice + uvec3(upperSides(corner));
  const uint index = level.hashed != 0 ? (c.x ^ (c.y * 2654435761u) ^ (c.z * 805459861u)) & (level.entries - 1)
                                       : (c.x + level.resolution * (c.y + level.resolution * c.z)) % level.entries;
  return level.firstEntry + index;
}

float cornerWeight(Cell cell, uint corner) {
  const vec3 w = mix(1.0 - cell.fraction, cell.fraction, upperSides(corner));
  return w.x * w.y * w.z;
}
